import dataclasses
import shutil
import subprocess

import numpy as np
import pytest
from support import SIMPLEGOAL

from vsp.paper import published_policy
from vsp.tasks import get_task
from vsp_beyond import device

WARNINGS = "-std=c99 -Wall -Wextra -pedantic -Werror -Wmissing-prototypes -Wdouble-promotion -Wconversion -O2".split()
ARM = "arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb --specs=rdimon.specs -Wl,--section-start=.vectors=0".split()
QEMU = "qemu-system-arm -M mps2-an386 -nographic -semihosting -kernel".split()
MAIN = """#include <math.h>
#include <stdio.h>
#include "policy.h"
#ifdef __ARM_ARCH
extern void _start(void);
__attribute__((section(".vectors"), used)) void *const vectors[] = {(void *)0x3ff000, (void *)_start};
#endif
static const REAL states[][2] = STATES;
int main(void) {
    for (unsigned i = 0; i < sizeof states / sizeof states[0]; i++) {
        REAL action[2];
        vsp_act(states[i], action);
        printf("%.9g %.9g\\n", (double)action[0], (double)action[1]);
    }
    return 0;
}
"""
POLICY, STATES = published_policy(SIMPLEGOAL), np.random.default_rng(0).random((300, 2))


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize(
    ("compiler", "start"), [(["gcc"], []), (["clang"], []), (ARM, QEMU)], ids=["gcc", "clang", "cortex-m4"]
)
def test_a_device_acts_as_the_policy_does(compiler, start, real, tmp_path):
    """The last state is not finite."""
    if not all(map(shutil.which, (compiler[0], *start[:1]))):
        pytest.skip(f"{compiler[0]}, or what runs its programs, is not there")
    safe, states = np.array([0.5, -0.5]), device.braces(STATES)[:-1] + ", {NAN, 0.5}}"
    (tmp_path / "policy.c").write_text(device.to_c(POLICY, real=real, safe=safe, states=STATES), "utf-8")
    (tmp_path / "policy.h").write_text(device.to_header(POLICY, real=real), "utf-8")
    (tmp_path / "main.c").write_text(MAIN.replace("STATES", states).replace("REAL", real), "utf-8")
    subprocess.run([*compiler[:3], *WARNINGS, "-c", "policy.c"], check=True, cwd=tmp_path)
    subprocess.run([*compiler, "-o", "run", "main.c", "policy.o", "-lm"], check=True, cwd=tmp_path)
    said = subprocess.run([*start, tmp_path / "run"], check=True, capture_output=True, text=True, timeout=60).stdout
    actions = np.array([line.split() for line in said.splitlines()], float)
    assert np.abs(actions[:-1] - POLICY.predict(STATES)[0]).max() < {"double": 1e-8, "float": 1e-5}[real]
    assert actions[-1].tolist() == [0.5, -0.5] and len(actions) == 301


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only"])
def test_a_compiler_that_ignores_what_is_no_number_is_refused(flag, tmp_path):
    (tmp_path / "policy.c").write_text(device.to_c(POLICY), "utf-8")
    done = subprocess.run(["gcc", flag, "-c", "policy.c"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode and "a state that is not a number would not be seen" in done.stderr


def test_by_hand_what_a_device_is_told():
    assert "state[1]: y, 0 to 1\n   action[0]: Δx, -1 to 1" in device.to_header(POLICY)
    maps = [[1, 0], [1, 0], [0, 0]], [[0, 0], [0, 0], [0.1, 1]]
    two = POLICY.__class__([[0.25, 0], [0.75, 0]], maps, task=SIMPLEGOAL)
    states = np.array([[0.3, 0.2], [0.9, 0.2], [0.6, 0.1], [0.4, 0.1]])
    assert device.largest_jump(two, states) == pytest.approx([0.6, 1.0])
    assert "jumps by at most 0.6, 1, as found around 4 states" in device.to_c(two, states=states)
    for wrong, said in (
        ({"real": "half"}, "expected 'double' or 'float'"), ({"safe": [2, 0]}, "within the limits"),
        ({"safe": [-2, 0]}, "within the limits"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            device.to_c(POLICY, **wrong)


def test_all_numbers_are_floats_and_no_name_ends_the_comment():
    task = dataclasses.replace(get_task(SIMPLEGOAL), outputs=("*/ int x;", "b"))
    small = POLICY.__class__([[0.5, 0.5]], np.full((1, 3, 2), 2.5e-7), task=task)
    assert "2.5e-07f" in device.to_c(small, real="float") and "*/ int x" not in device.to_header(small)
