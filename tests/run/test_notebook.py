import asyncio
import subprocess
import sys
import time
from types import SimpleNamespace

import nbclient.client
import pytest
import zmq
import zmq.asyncio
from jupyter_client.channels import AsyncZMQSocketChannel
from jupyter_client.session import Session
from nbclient.output_widget import OutputWidget

from vsp.run import notebook
from vsp.run.atomic import ROOT


def test_no_grammar_of_addresses_is_built_and_who_asks_for_one_finds_it():
    """In a process of its own: here somebody may have asked before."""
    code = (
        "import sys, importlib.util; from vsp.run.notebook import NotebookNode, nbformat; "
        "assert 'jsonschema' in sys.modules and not [n for n in sys.modules if n.startswith(('rfc398', 'lark'))]; "
        "assert importlib.util.find_spec('rfc3987_syntax'); "
        "nbformat.validate(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell('1 + 1')]))"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


async def seconds_for_a_reply(kind):
    """How long one waits for a reply that came just before an output widget, of `kind`, sent something."""
    session, kernel = Session(key=b"any"), zmq.Context.instance().socket(zmq.ROUTER)
    with kernel, zmq.asyncio.Context.instance().socket(zmq.DEALER) as shell:
        shell.connect(f"tcp://127.0.0.1:{kernel.bind_to_random_port('tcp://127.0.0.1')}")
        client = SimpleNamespace(session=session, shell_channel=AsyncZMQSocketChannel(shell, session))
        widget = kind("id", {"outputs": []}, client, None)
        widget.parent_header = {}
        widget.sync_state()
        sender, _ = session.feed_identities(kernel.recv_multipart())
        reply = asyncio.ensure_future(client.shell_channel.get_msg(timeout=0.6))
        await asyncio.sleep(0.1)
        session.send(kernel, "execute_reply", {}, ident=sender)
        time.sleep(0.1)  # it is there, and nobody has looked
        widget.sync_state()
        begin = time.perf_counter()
        assert (await reply)["msg_type"] == "execute_reply"
        return time.perf_counter() - begin


@pytest.mark.parametrize(("kind", "at_once"), [(notebook.OutputWidget, True), (OutputWidget, False)])
def test_a_reply_is_seen_although_a_widget_sends(kind, at_once):
    """Where nbclient's own does so too, ours can go."""
    assert (asyncio.run(seconds_for_a_reply(kind)) < 0.3) == at_once


def test_notebooks_run_with_the_mended_widget():
    assert nbclient.client.OutputWidget is notebook.OutputWidget
    client = nbclient.client.NotebookClient(notebook.nbformat.v4.new_notebook())
    assert notebook.OutputWidget in client.widget_registry["@jupyter-widgets/output"].values()
