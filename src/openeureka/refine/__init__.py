"""What may follow a search: tuning a reward, polishing a policy, hardening it."""
