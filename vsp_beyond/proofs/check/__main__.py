"""Check certificates: `python -m vsp_beyond.proofs.check FILE ...`."""

import sys

from . import Refused
from .certificates import check_content, read

SAMPLED = ["MountainCarContinuous-v0"]  # one start of each block is played; the proof itself takes minutes


def main() -> None:
    """Print what each file proves; stop at the first that does not prove its claim."""
    if not sys.argv[1:]:
        sys.exit("expected one or more certificates, such as data/beyond/proofs/*.json")
    for name in sys.argv[1:]:
        try:
            claim = check_content(content := read(name))
            print(name, "agrees, in a sample, with" if content["task"] in SAMPLED else "proves", claim)
        except (Refused, OSError) as refusal:
            sys.exit(f"{name}: {refusal}")


if __name__ == "__main__":
    main()
