"""Time from the start of the editor to its first image, on an Xvfb display of 1600 x 1000 and the Vulkan driver of the machine:
medians in milliseconds.

    python benches/start_up.py [--cold] [--repeat 5] [SCENE ...]

Times "on the screen" come from the memory of the display: the first pixels of the window, and those of the object. Other times come
from `biscale edit --start-times`; a version without that option is stopped at its first image. With `--cold`, the driver has an empty
shader cache at each start.
"""

import argparse
import mmap
import os
import re
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

BISCALE = os.environ.get("BISCALE", str(Path(__file__).resolve().parents[1] / "target/release/biscale"))
SCENES = ["default", "table4_cup", "table4_plate", "table4_teapot", "table4_pillow", "table4_skirt"]
WINDOW = (1440, 900)
# A pixel of the menu, and pixels around the middle of the object view, beside the text that it shows first.
MENU = (700, 12)
OBJECT = [(426 + x, 462 + y) for x in (-90, -60, 60, 90) for y in (-90, -60, 60, 90)]
EMPTY = (22, 22, 22)
REPORTED = ["device and the interface's pipelines built", "first frame presented", "first image rendered", "first image presented"]
HAS_START_TIMES = "--start-times" in subprocess.run([BISCALE, "edit", "--help"], capture_output=True, text=True).stdout


class Screen:
    """The memory of an Xvfb display, which is an XWD file."""

    def __init__(self, path):
        with open(path, "rb") as file:
            self.bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        header = struct.unpack(">25I", self.bytes[:100])
        self.start, self.row = header[0] + 12 * header[19], header[12]

    def pixel(self, x, y):
        at = self.start + y * self.row + 4 * x
        return tuple(self.bytes[at : at + 3])


def started(scene, screen, environment):
    """Returns the milliseconds of one start, by name."""
    times = {}
    start = time.perf_counter()
    command = [BISCALE, "edit", *["--start-times"][:HAS_START_TIMES], scene]
    editor = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    lines = []
    listener = threading.Thread(target=lambda: lines.extend(editor.stderr))
    listener.start()
    while editor.poll() is None and time.perf_counter() - start < 60:
        now = 1e3 * (time.perf_counter() - start)
        if "window on the screen" not in times and any(screen.pixel(*MENU)):
            times["window on the screen"] = now
        if "window on the screen" in times and "image on the screen" not in times:
            pixels = [screen.pixel(*at) for at in OBJECT]
            if all(pixel != EMPTY and any(pixel) for pixel in pixels):
                times["image on the screen"] = now
                if not HAS_START_TIMES:
                    editor.terminate()
        time.sleep(0.002)
    editor.kill()
    listener.join()
    for line in lines:
        found = re.match(r" *([0-9.]+) ms  (.*)", line)
        name = found and next((name for name in REPORTED if found[2].startswith(name)), None)
        if name:
            times.setdefault(name, float(found[1]))
    return times


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cold", action="store_true")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    options = parser.parse_args()
    if not shutil.which("Xvfb"):
        print("SKIPPED: no Xvfb (apt-get install xvfb)")
        sys.exit(0)
    with tempfile.TemporaryDirectory() as folder:
        state = Path(folder) / "state/biscale"
        state.mkdir(parents=True)
        (state / "editor.toml").write_text("welcomed = true\nwindow = [%d.0, %d.0]\n" % WINDOW)
        reader, writer = os.pipe()
        server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writer), "-screen", "0", "1600x1000x24", "-fbdir", folder, "-nolisten", "tcp"],
            pass_fds=[writer],
            stderr=subprocess.DEVNULL,
        )
        try:
            display = os.read(reader, 32).decode().strip()
            screen = Screen(Path(folder) / "Xvfb_screen0")
            environment = {**os.environ, "DISPLAY": f":{display}", "XDG_STATE_HOME": f"{folder}/state", "XDG_RUNTIME_DIR": folder}
            environment.pop("WAYLAND_DISPLAY", None)
            names = ["window on the screen", "image on the screen", *REPORTED]
            titles = [name.replace("device and the interface's pipelines built", "device, pipelines") for name in names]
            cache = "an empty" if options.cold else "a filled"
            print(f"{BISCALE}, {os.cpu_count()} cores, {cache} shader cache; medians of {options.repeat} starts [ms]")
            print(f"{'scene':<16}" + "".join(f"  {name}" for name in titles))
            for scene in options.scenes:
                runs = []
                # One more start fills the caches and is not counted.
                for k in range(options.repeat + (not options.cold)):
                    if options.cold:
                        environment["MESA_SHADER_CACHE_DIR"] = f"{folder}/cache_{scene}_{k}"
                    runs.append(started(scene, screen, environment))
                    time.sleep(0.3)
                medians = [statistics.median(run.get(name, float("nan")) for run in runs[-options.repeat :]) for name in names]
                print(f"{scene:<16}" + "".join(f"{ms:>{len(name) + 2}.0f}" for name, ms in zip(titles, medians)), flush=True)
        finally:
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main()
