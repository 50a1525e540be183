"""Methods to compare our cells with: trees, soft trees, small networks, critics, TD-AVQ, DAgger, hand-written rules."""
