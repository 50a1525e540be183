"""Check certificates: `python -m vsp_beyond.proofs.check FILE ...`."""

import sys

from . import Refused, check


def main() -> None:
    """Print what each file proves; stop at the first that does not prove its claim."""
    if not sys.argv[1:]:
        sys.exit("expected one or more certificates, such as data/beyond/proofs/*.json")
    for name in sys.argv[1:]:
        try:
            print(name, "proves", check(name))
        except (Refused, OSError) as refusal:
            sys.exit(f"{name}: {refusal}")


if __name__ == "__main__":
    main()
