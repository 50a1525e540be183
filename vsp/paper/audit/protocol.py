"""Findings about the protocol: how many policies, how many steps, and when the partition may change."""

from __future__ import annotations

from ...tasks.registry import get_task
from .. import printed
from ..printed import PREFIX, SHORT, printed_value
from .columns import Column
from .finding import HOLDS, OPEN, Finding, compared, quote

MOUNTAINCAR = printed.TASKS[1]


def run_counts() -> Finding:
    """Compare the numbers of distilled policies that the protocol, the text and the coverage imply."""
    notes, ids, wrong = [], [], []
    for task, name in PREFIX.items():
        protocol, text = printed_value(f"{name}_policies"), printed_value(f"{name}_text_policies")
        asked = printed_value(f"{name}_ours_outliers") / (1 - Column(task, "ours").values["coverage"] / 100)
        notes.append(f"{SHORT[task]}: {protocol:.0f} and {text:.0f}; the coverage asks for {asked:.0f} episodes")
        ids += [f"{name}_policies", f"{name}_text_policies"]
        wrong += [f"{name}_text_policies"] * (text != protocol)
    return compared("Number of distilled policies", quote(*ids), "; ".join(notes), not wrong, wrong)


def truncation() -> Finding:
    """Compare the longest episode as printed with that of the registered environment."""
    steps, limit, lowest = get_task(MOUNTAINCAR).max_steps, printed_value("mc_max_steps"), printed_value("mc_ours_min")
    text = (
        f"{limit:.0f} and {steps} of the registered environment. No printed return depends on it: the lowest, "
        f"{lowest:.3f}, is positive, and an episode without the goal earns at most 0"
    )
    return Finding("MountainCar: truncation", quote("mc_max_steps"), text, HOLDS if limit == steps else OPEN)


def thousands() -> Finding:
    """Show that the dot of one number separates thousands, but the dots of all others decimals."""
    numbers, steps = printed.printed_text_numbers()["printed"], printed_value("sg_training_steps")
    decimal = float(numbers["sg_training_steps"])
    others = numbers.drop("sg_training_steps").str.fullmatch("-?[0-9]+[.][0-9]+%?").sum()
    episodes = decimal / printed_value("sg_max_steps")
    text = (
        f"as a decimal, like {others} others with a dot: {decimal:g} steps, {episodes:g} episodes of full length, "
        f"not {steps:g}; other thousands have no separator"
    )
    shown = quote("sg_training_steps", "sg_total_episodes", "mc_total_episodes")
    return Finding(
        "Training steps: a dot for thousands, elsewhere for decimals", shown, text, HOLDS if decimal == steps else OPEN
    )


def frozen_iterations() -> Finding:
    """Count the iterations that may alter the partition, by each of the three places that state it."""
    notes, agrees, ids = [], True, []
    for task, name in PREFIX.items():
        hyper = printed.printed_hyperparameters(task)
        epochs, split, freeze = (hyper[f"n_{what}"] for what in ("epochs", "split", "freeze"))
        agrees &= len({epochs - freeze, freeze, epochs - split}) == 1
        counts = f"{epochs} - {freeze} = {epochs - freeze}, {freeze}, {epochs} - {split} = {epochs - split}"
        notes.append(f"{SHORT[task]} {counts}")
        ids += [f"{name}_hyper_n_{what}" for what in ("epochs", "freeze", "split")]
    shown = "last n_freeze iterations frozen (Partitioning the state space); altered while n is below n_freeze "
    shown += f"(Algorithm 1); last n_split frozen (Learning subpolicies); {quote(*ids)}"
    text = f"iterations that may alter the partition: {'; '.join(notes)}"
    return compared("Which iterations may change the partition", shown, text, agrees)
