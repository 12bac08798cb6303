import numpy as np
import pytest
import torch

from openeureka.film.looks import PREFIX
from openeureka.film.stage import Stage
from openeureka.suite.dexterity.re_orientation import ShadowHandReOrientation
from openeureka.tasks import registry


def test_a_stage_shows_the_world_as_it_is():
    stage = Stage("shadow_hand_push_block", "random", seed=0)
    before = stage.data.qpos.copy()
    stage.step()
    assert not np.array_equal(stage.data.qpos, before)


def test_each_block_has_a_ghost_at_its_goal_which_touches_nothing():
    stage = Stage("shadow_hand_push_block", "zero", seed=0)
    for block, goal in (("object", (-0.2, 0.2, 0.625)), ("block_left", (-0.2, -0.2, 0.625))):
        ghost = stage.model.body(PREFIX + block)
        assert stage.data.body(ghost.id).xpos == pytest.approx(goal)
        geoms = range(ghost.geomadr[0], ghost.geomadr[0] + ghost.geomnum[0])
        assert len(geoms) and not any(stage.model.geom_contype[i] or stage.model.geom_conaffinity[i] for i in geoms)


def test_ghosts_follow_the_goals():
    stage = Stage("shadow_hand_re_orientation", "zero", seed=0)
    before = stage.data.body(PREFIX + "object_another").xquat.copy()
    task = stage._simulation.task
    assert isinstance(task, ShadowHandReOrientation)
    task.reached[:] = True
    stage.step()
    after = stage.data.body(PREFIX + "object_another").xquat
    assert not np.allclose(after, before)
    x, y, z, w = task.goal_poses[0, 1, 3:].tolist()
    assert after == pytest.approx((w, x, y, z), abs=1e-6)


def test_pictures_leave_the_physics_alone():
    task = registry.get("shadow_hand_over")
    Stage(task.env, "random", seed=0)
    assert task.compile_model().nmocap == 0


def test_the_stack_is_shown_as_it_should_stand():
    simulation = registry.make("shadow_hand_block_stack", worlds=1)
    ghosts = simulation.task.ghosts()
    assert ghosts["object"][0, :3].tolist() == pytest.approx([0.0, 0.0, 0.625])
    assert ghosts["block"][0, :3].tolist() == pytest.approx([0.0, 0.0, 0.675])
    assert torch.equal(ghosts["object"][:, 3:], ghosts["block"][:, 3:])


def test_goals_without_a_meaningful_place_are_not_shown():
    assert registry.make("shadow_hand_kettle", worlds=1).task.ghosts() == {}
