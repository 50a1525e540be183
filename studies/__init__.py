"""Experiments beyond the paper: other methods, what each part of ours does, robots. Nothing imports them."""
