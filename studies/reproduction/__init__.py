"""Experiments on the reproduction: the search for hidden settings, wrong verdicts, simpler policies."""
