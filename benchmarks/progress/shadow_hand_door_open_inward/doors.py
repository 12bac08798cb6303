import torch


def compute_reward(
    right_hand_th_pos,
    right_hand_ff_pos,
    right_hand_mf_pos,
    left_hand_th_pos,
    left_hand_ff_pos,
    left_hand_mf_pos,
    door_right_handle_pos,
    door_left_handle_pos,
):
    """Each door by itself: thumb and two fingers on its handle, and how far that came towards the hands."""

    def pinch(thumb, first, middle, handle):
        return (torch.stack((thumb, first, middle), dim=1) - handle.unsqueeze(1)).norm(dim=-1).mean(dim=-1)

    right = pinch(right_hand_th_pos, right_hand_ff_pos, right_hand_mf_pos, door_right_handle_pos)
    left = pinch(left_hand_th_pos, left_hand_ff_pos, left_hand_mf_pos, door_left_handle_pos)
    right_pull = door_right_handle_pos[:, 0] - 0.048
    left_pull = door_left_handle_pos[:, 0] - 0.046
    pinched = torch.exp(-right / 0.08) + torch.exp(-left / 0.08)
    pulled = torch.tanh(right_pull / 0.05) + torch.tanh(left_pull / 0.05)
    opened = torch.clamp(right_pull, 0.0, 0.5) + torch.clamp(left_pull, 0.0, 0.5)
    slower = torch.clamp(torch.minimum(right_pull, left_pull) / 0.3, 0.0, 1.5)
    reward = 0.5 * pinched + 1.0 * pulled + 4.0 * opened + 4.0 * slower
    progress_pinch = 1.0 - torch.maximum(right, left) / 0.25
    progress_right = right_pull / 0.3
    progress_left = left_pull / 0.3
    components = {"pinched": pinched, "pulled": pulled, "opened": opened, "slower": slower}
    told = {"progress_pinch": progress_pinch, "progress_right": progress_right, "progress_left": progress_left}
    return reward, {**components, **told}
