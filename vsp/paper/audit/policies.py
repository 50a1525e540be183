"""Findings about the printed policies, tables T3 and T4."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd

from ...geometry import delaunay_neighbours, distances
from ...tasks.simplegoal import PIT_HIGH, PIT_LOW
from .. import printed
from ..printed import PREFIX, SHORT, printed_value
from .finding import HOLDS, OPEN, Finding, compared, quote

SIMPLEGOAL, MOUNTAINCAR = printed.TASKS


def printed_digits() -> Finding:
    """Test three meanings of "rounded to 4 digits" on all coefficients and codewords of T3 and T4."""
    ids = ["sg_table_digits", "mc_table_digits"]
    rows, digits = printed.printed_values(), printed_value(ids[0])
    numbers = rows.loc[rows["id"].str.contains("_cell_"), "paper"].str.lstrip("-")
    counts = {
        "decimals": numbers.str.partition(".")[2].str.len(),
        "digits": numbers.str.replace(".", "").str.len(),
        "significant digits": numbers.str.replace(".", "").str.lstrip("0").str.len(),
    }
    notes = [f"{(n == digits).sum()} have {digits:g} {kind} (all {n.min()} to {n.max()})" for kind, n in counts.items()]
    agrees = any((n == digits).all() for n in counts.values())
    text = f"Of {len(numbers)} numbers {', '.join(notes)}"
    return compared("T3 and T4: coefficients rounded to four digits", quote(*ids), text, agrees, ids)


def simplegoal_rows() -> Finding:
    """Find rows of T3 without an x in any output, and codewords that lie in the pit."""
    frame = printed.linear_policies(SIMPLEGOAL)
    codewords, equations = frame.filter(like="codeword_"), frame.filter(like="_printed")
    in_pit = ((codewords > PIT_LOW) & (codewords < PIT_HIGH)).all(axis=1)
    without = ~equations.apply(lambda column: column.str.contains("x")).any(axis=1)
    text = (
        f"{without.sum()} of {len(frame)} rows: no x in any output. {in_pit.sum()} of {len(frame)} codewords: in the "
        "pit. Codewords are states that the teacher acts in, and entering the pit ends an episode, so one started there"
    )
    shown = "; ".join(
        f"{codewords.loc[i].tolist()}: {', '.join(equations.loc[i])} ({frame.at[i, 'where']})"
        for i in frame.index[without | in_pit]
    )
    return Finding("T3: a row without x, a codeword in the pit", shown, text, OPEN)


def mountaincar_colours() -> Finding:
    """Find colours of T4 whose forces at the codewords overlap."""
    frame, policy = printed.linear_policies(MOUNTAINCAR), printed.published_policy(MOUNTAINCAR)
    force = pd.Series(policy.predict(policy.codewords)[0][:, 0]).groupby(frame["colour"])
    low, high = force.min(), force.max()
    overlaps = [f"{a} and {b}" for a, b in combinations(low.index, 2) if low[a] <= high[b] and low[b] <= high[a]]
    ranges = ", ".join(f"{colour} {low[colour]:.3f} to {high[colour]:.3f}" for colour in low.index)
    shown = f"the colours of {len(frame)} functions, said to be those of the force map (T4, caption)"
    text = f"force at the codewords: {ranges}; overlap: {', '.join(overlaps) or 'none'}"
    return Finding("T4: colours against the force", shown, text, OPEN if overlaps else HOLDS)


def close_pairs(task: str, table: str) -> Finding:
    """Find pairs of codewords, and neighbours' parameters, closer than the thresholds of splits and merges."""
    policy, limits = printed.published_policy(task), printed.printed_hyperparameters(task)
    codewords, (i, j) = policy.codewords, np.triu_indices(len(policy), 1)
    gaps, neighbours = np.abs(policy.coefficients[i] - policy.coefficients[j]), delaunay_neighbours(codewords)[i, j]
    apart, alike = limits["min_pol_distance"], limits["min_param_distance"]
    close = {norm: distances(codewords, codewords, norm)[i, j] < apart for norm in ("manhattan", "euclidean")}
    for name, terms in (("parameters", gaps), ("weights", gaps[:, :-1])):
        close[f"L-infinity of all {name}, neighbours"] = neighbours & (terms.max(axis=(1, 2)) < alike)
    notes = []
    for name, mask in close.items():
        rows = ", ".join(f"{a + 1}-{b + 1}" for a, b in zip(i[mask], j[mask]))
        notes.append(f"{name}: {mask.sum()} (rows {rows})" if rows else f"{name}: 0")
    ids = [f"{PREFIX[task]}_hyper_{name}" for name in ("min_pol_distance", "min_param_distance")]
    text = f"of {len(i)} pairs, {neighbours.sum()} of them Delaunay neighbours, are closer in {'; '.join(notes)}"
    return Finding(f"{table}: pairs closer than the thresholds", quote(*ids), text, OPEN)


def outputs_beyond_limits() -> Finding:
    """Count linear outputs at the codewords that lie outside the action limits before clipping."""
    notes = []
    for task in printed.TASKS:
        policy = printed.published_policy(task)
        raw = np.abs(policy.linear(policy.codewords))
        beyond = raw > policy.task.action_high
        notes.append(f"{SHORT[task]}: {beyond.sum()} of {raw.size} outputs at codewords, up to {raw.max():.3f}")
    shown = quote("sg_action_low", "sg_action_high", "mc_force_low", "mc_force_high")
    return Finding("T3 and T4: outputs beyond the limits of actions", shown, "; ".join(notes), OPEN)


def dimensions() -> Finding:
    """Compare the coordinates and outputs counted in T3 and T4 with those that the text states."""
    frames = [printed.linear_policies(task) for task in printed.TASKS]
    states, actions = ([frame.filter(like=like).shape[1] for frame in frames] for like in ("codeword_", "_printed"))
    text = f"coordinates of codewords (T3, T4): {states}; outputs: {actions}"
    agrees = set(states) == {printed_value("state_dimensions")} and set(actions) == {printed_value("action_dimensions")}
    shown = quote("state_dimensions", "action_dimensions")
    return compared("Dimensions of states and actions", shown, text, agrees, ["action_dimensions"])
