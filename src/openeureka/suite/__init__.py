"""The tasks that come with openeureka. `openeureka.tasks` knows them only by this table."""

from __future__ import annotations

TASKS = {
    "cartpole": "openeureka.suite.isaac.cartpole:Cartpole",
    "ant": "openeureka.suite.isaac.ant:Ant",
    "humanoid": "openeureka.suite.isaac.humanoid:Humanoid",
    "anymal": "openeureka.suite.isaac.anymal:Anymal",
    "ballbalance": "openeureka.suite.isaac.ballbalance:BallBalance",
    "quadcopter": "openeureka.suite.isaac.quadcopter:Quadcopter",
    "franka_cabinet": "openeureka.suite.isaac.franka_cabinet:FrankaCabinet",
    "allegro_hand": "openeureka.suite.isaac.allegro_hand:AllegroHand",
    "shadow_hand": "openeureka.suite.isaac.shadow_hand:ShadowHand",
    "shadow_hand_over": "openeureka.suite.dexterity.catch:ShadowHandOver",
    "shadow_hand_catch_underarm": "openeureka.suite.dexterity.catch:ShadowHandCatchUnderarm",
    "shadow_hand_catch_over2underarm": "openeureka.suite.dexterity.catch:ShadowHandCatchOver2Underarm",
    "shadow_hand_catch_abreast": "openeureka.suite.dexterity.catch:ShadowHandCatchAbreast",
    "shadow_hand_two_catch_underarm": "openeureka.suite.dexterity.two_catch_underarm:ShadowHandTwoCatchUnderarm",
    "shadow_hand_lift_underarm": "openeureka.suite.dexterity.lift_underarm:ShadowHandLiftUnderarm",
    "shadow_hand_door_open_inward": "openeureka.suite.dexterity.doors:ShadowHandDoorOpenInward",
    "shadow_hand_door_open_outward": "openeureka.suite.dexterity.doors:ShadowHandDoorOpenOutward",
    "shadow_hand_door_close_inward": "openeureka.suite.dexterity.doors:ShadowHandDoorCloseInward",
    "shadow_hand_door_close_outward": "openeureka.suite.dexterity.doors:ShadowHandDoorCloseOutward",
    "shadow_hand_swing_cup": "openeureka.suite.dexterity.swing_cup:ShadowHandSwingCup",
    "shadow_hand_bottle_cap": "openeureka.suite.dexterity.bottle_cap:ShadowHandBottleCap",
    "shadow_hand_push_block": "openeureka.suite.dexterity.push_block:ShadowHandPushBlock",
    "shadow_hand_grasp_and_place": "openeureka.suite.dexterity.grasp_and_place:ShadowHandGraspAndPlace",
    "shadow_hand_block_stack": "openeureka.suite.dexterity.block_stack:ShadowHandBlockStack",
    "shadow_hand_scissors": "openeureka.suite.dexterity.scissors:ShadowHandScissors",
    "shadow_hand_switch": "openeureka.suite.dexterity.switch:ShadowHandSwitch",
    "shadow_hand_pen": "openeureka.suite.dexterity.pen:ShadowHandPen",
    "shadow_hand_re_orientation": "openeureka.suite.dexterity.re_orientation:ShadowHandReOrientation",
    "shadow_hand_kettle": "openeureka.suite.dexterity.kettle:ShadowHandKettle",
    "shadow_hand_spin": "openeureka.suite.dexterity.pen_in_hand:ShadowHandSpin",
    "shadow_hand_upside_down": "openeureka.suite.dexterity.pen_in_hand:ShadowHandUpsideDown",
}
"""Name -> import string."""
