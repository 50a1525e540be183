"""What tests read off axes."""

import matplotlib as mpl


def named(ax):
    """What is drawn, by its name in a legend."""
    return dict(zip(*reversed(ax.get_legend_handles_labels())))


def labels(ax):
    return [text.get_text() for text in ax.get_yticklabels()]


def hexes(colours):
    return [mpl.colors.to_hex(colour) for colour in colours]
