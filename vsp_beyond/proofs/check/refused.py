"""The error that the checkers raise."""

MOST = 900  # characters that it says


class Refused(Exception):
    """The certificate does not prove its claim."""

    def __str__(self) -> str:
        return super().__str__()[:MOST]
