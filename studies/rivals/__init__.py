"""Methods to compare our cells with: trees, small networks, critics, TD-AVQ, DAgger."""
