"""Docstrings of vsp for autodoc: plain prose with `code`, and comments behind the fields of a dataclass."""


def setup(app):
    return {"parallel_read_safe": True, "parallel_write_safe": True}
