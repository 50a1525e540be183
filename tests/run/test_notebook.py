from support import python


def test_no_grammar_of_addresses_is_built_and_who_asks_for_one_finds_it():
    """In a process of its own: here somebody may have asked before."""
    python(
        "import sys, importlib.util; from vsp.run.notebook import NotebookNode, nbformat; "
        "assert 'jsonschema' in sys.modules and not [n for n in sys.modules if n.startswith(('rfc398', 'lark'))]; "
        "assert importlib.util.find_spec('rfc3987_syntax'); "
        "nbformat.validate(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell('1 + 1')]))"
    )
