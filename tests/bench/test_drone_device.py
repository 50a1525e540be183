"""The drone's maps in C for a Crazyflie's kind of processor: its size, and the instructions that QEMU executes."""

import shutil
import subprocess

import pytest

from studies.drone import own_teacher
from vsp_beyond import device
from vsp_beyond.drone import few_maps
from vsp_beyond.drone.flights import command_of

ARM = "arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard -O2".split()
LINK = "--specs=rdimon.specs -Wl,--section-start=.vectors=0 main.c policy.o -lm -o run".split()
QEMU = "qemu-system-arm -M mps2-an386 -nographic -semihosting -singlestep -d nochain,exec -D log -kernel run".split()
MAIN = """#include "policy.h"
extern void _start(void);
static void begin(void) { *(volatile unsigned *)0xE000ED88 |= 0xF << 20; _start(); } /* floating point on */
__attribute__((section(".vectors"), used)) void *const vectors[] = {(void *)0x3ff000, (void *)begin};
static volatile float state[16] = {0.1f, 0.2f};
int main(void) {
    float seen[16], action[4];
    for (int i = 0; i < 16; i++) seen[i] = state[i];
    for (int i = 0; i < CALLS; i++) vsp_act(seen, action);
    return 0;
}
"""


@pytest.mark.skipif(not all(map(shutil.which, (ARM[0], QEMU[0]))), reason="no compiler for ARM, or no QEMU")
@pytest.mark.parametrize(("name", "n_cells"), [("one map", 1), ("four cells", 4)])
def test_maps_on_a_microcontroller(name, n_cells, tmp_path, record):
    """QEMU counts no cycles; what a call executes is the difference between two calls and one."""
    policy = few_maps(command_of(own_teacher()), seed=0, n_cells=n_cells)
    (tmp_path / "policy.c").write_text(device.to_c(policy, real="float"), "utf-8")
    (tmp_path / "policy.h").write_text(device.to_header(policy, real="float"), "utf-8")
    subprocess.run([*ARM, "-c", "policy.c"], check=True, cwd=tmp_path)
    executed = []
    for calls in (1, 2):
        (tmp_path / "main.c").write_text(MAIN.replace("CALLS", str(calls)), "utf-8")
        subprocess.run([*ARM, *LINK], check=True, cwd=tmp_path)
        subprocess.run(QEMU, check=True, cwd=tmp_path, timeout=60)
        executed.append(len((tmp_path / "log").read_bytes().splitlines()))
    size = subprocess.run(["arm-none-eabi-size", "policy.o"], check=True, cwd=tmp_path, capture_output=True, text=True)
    size, executed = int(size.stdout.split()[-3]), executed[1] - executed[0]
    assert executed > 200  # it multiplies
    note = "Cortex-M4 with floating point, gcc -O2"
    record("speed", f"a drone's {name}: program and numbers", size, "bytes", at_most=1000 * n_cells, note=note)
    record("speed", f"a drone's {name}: a call in QEMU", executed, "instructions", at_most=1000 * n_cells, note=note)
