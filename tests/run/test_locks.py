import signal
import subprocess
import sys

import pytest

from vsp.run.atomic import ROOT
from vsp.run.command import CommandError
from vsp.run.locks import folder_lock

HOLD = """
import sys
from vsp.run.locks import folder_lock
with folder_lock(sys.argv[1], "busy"):
    print(1, flush=True)
    input()
"""


def test_the_second_is_refused_until_the_first_ends_or_is_killed(tmp_path):
    lock = tmp_path / "build" / "lock"
    command = [sys.executable, "-c", HOLD, lock]
    first = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    first.stdout.readline()
    with pytest.raises(CommandError, match="another run: wait for it to end"), folder_lock(lock, "another run"):
        pytest.fail("came in")
    first.kill()
    assert first.wait() == -signal.SIGKILL
    for _ in range(2):
        with folder_lock(lock, "another run"):
            pass
    first.communicate()
