"""Lane-batched PPO: the candidates of a generation train side by side in one batch."""
