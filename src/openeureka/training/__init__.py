"""Lane-batched PPO: one process trains all candidates of a generation."""
