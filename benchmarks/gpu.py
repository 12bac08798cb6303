"""Measures the simulator and the trainer on a GPU, in one call.

    python benchmarks/gpu.py                                # every part of every task on cuda:0: hours
    python benchmarks/gpu.py --env humanoid --part lanes    # some of it
    python benchmarks/gpu.py --device warp-cpu --tiny --env cartpole --out outputs/gpu.json
                                                            # minutes without a GPU, to see that it works

The parts, in this order, each for every task:

    parity      the first steps of this device's simulator compared with those of the CPU simulator
    raw         bare stepping with random controls, as many worlds as 16 lanes have
    env         the task's environment with random actions: state, observation, resets
    lanes       training of 1, 4 and 16 lanes, each with a reward program of its own, in one process
    processes   the 16 lanes as 16 processes on the same device
    epoch       one epoch of the 16 lanes: its time, how long of it the device works, and how often the host waits
    human       the human reward, four seeds, trained for a fixed time and scored on held-out episodes

`--out` is written after each part and read at the start: an interruption loses one part, and the same command goes on.
No part uses the device in this process, so that a fault there ends that part only; its error is recorded, and the next
call tries again. Trainings are timed as a whole, so an interrupted one begins anew, unlike those of a run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from gpu_parts import Found, Sizes, environment, epoch, human, machine, parity, raw, training
from records import command_line, read, results, show, today, write
from throughput import sleep_when_idle

from openeureka.tasks import registry

KINDS = ("parity", "raw", "env", "lanes", "processes", "epoch", "human")
RESULTS = results("gpu")
Part = tuple[str, Callable[..., Found], tuple[Any, ...]]


def plan(envs: Sequence[str], kinds: Sequence[str], lanes: Sequence[int], sizes: Sizes, found: Found) -> Iterator[Part]:
    """Name, function and extra arguments of every part in turn; the last kind reads what the others `found`."""
    some, most = sizes.lanes[1], max(sizes.lanes)
    for kind in kinds:
        for env in envs:
            match kind:
                case "parity":
                    yield f"parity/{env}", parity, ()
                case "raw":
                    yield f"raw/{env}", raw, ()
                case "env":
                    yield f"env/{env}", environment, ()
                case "lanes":
                    for count in lanes:
                        yield f"lanes/{env}/{count}", training, (count, 1)
                case "processes":
                    yield f"processes/{env}/{most}", training, (most, most)
                case "epoch":
                    yield f"epoch/{env}/{most}", epoch, ()
                case "human":
                    known = f"lanes/{env}/{some}"
                    if not _done(found, known):
                        yield known, training, (some, 1)
                    if _done(found, known):
                        yield f"human/{env}", human, (found["parts"][known]["steps_per_second"],)


def _done(found: Found, name: str) -> bool:
    return "error" not in found["parts"].get(name, {"error": "not tried"})


def attempt(part: Callable[..., Found], *arguments: Any) -> Found:
    """The part's answer, or why it has none, and how long it took."""
    began = time.perf_counter()
    try:
        found = part(*arguments) if part in (training, human) else _isolated(part, *arguments)
    except Exception as error:
        found = {"error": f"{type(error).__name__}: {error}"}
    return {**found, "seconds": round(time.perf_counter() - began, 3)}


def _isolated(part: Callable[..., Found], *arguments: Any) -> Found:
    """Run a part in a separate process. Trainings need none here: they have worker processes."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        return process.submit(part, *arguments).result()


TITLES = (
    "task",
    "physics alone",
    "with observations and resets",
    "training 1 lane",
    "4 lanes",
    "16 lanes",
    "16 processes",
    "memory of a world",
)


def rows(found: Found) -> list[list[str]]:
    """What was measured of each task's speed, in environment steps a second."""
    parts = {name: part for name, part in found.get("parts", {}).items() if "steps_per_second" in part}

    def rate(name: str) -> str:
        return f"{parts[name]['steps_per_second']:,}" if name in parts else ""

    table: list[list[str]] = []
    for env in dict.fromkeys(name.split("/")[1] for name in parts):
        memory = parts.get(f"raw/{env}", {}).get("bytes_per_world", 0)
        trained = [rate(f"lanes/{env}/{lanes}") for lanes in (1, 4, 16)]
        cells = [rate(f"raw/{env}"), rate(f"env/{env}"), *trained, rate(f"processes/{env}/16")]
        table.append([f"`{env}`", *cells, f"{memory / 1000:,.0f} kB" if memory else ""])
    return table


def line(name: str, part: Found) -> str:
    """One part in a few words."""
    if "error" in part:
        return f"{name:32s} {part['error'][:150]}"
    if "lanes" in part:
        scores = [lane["held_out_at_peak_of_fitness"]["fitness"] for lane in part["lanes"].values()]
        shown = ", ".join("-" if score is None else f"{score:.3g}" for score in scores)
        return f"{name:32s} held-out F {shown} after {part['seconds_of_training']:.0f} s of training"
    if "steps_per_second" in part:
        return f"{name:32s} {part['steps_per_second']:>12,} steps/s"
    if "waits" in part:
        host, device = part["seconds_of_an_epoch"], part["seconds_of_the_device"]
        return f"{name:32s} {host} s, the device works {device} s, the host waits {part['waits']:g} times"
    worst = part["differences"][0]
    shown = ", ".join(f"{key} {value:.2g}" for key, value in worst.items() if key != "variable")
    return f"{name:32s} {worst['variable']} differs most: {shown}"


def main(words: Sequence[str] | None = None) -> None:
    parser = command_line(__doc__)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--part", action="append", choices=KINDS, help="a part; may be repeated")
    parser.add_argument("--lanes", action="append", type=int, help="lanes of a part `lanes`; may be repeated")
    parser.add_argument("--worlds", type=int, default=1024, help="worlds of a lane")
    parser.add_argument("--measure", type=float, default=10.0, help="[s] of each rate")
    parser.add_argument("--train", type=float, default=120.0, help="[s] of training with each human reward")
    parser.add_argument("--tiny", action="store_true", help="as little as possible, for a look")
    parser.add_argument("--again", action="store_true", help="repeat parts that the file holds")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(words)
    full = Sizes(worlds=options.worlds, lanes=(1, 4, 16), measure=options.measure, train=options.train, parity_steps=50)
    sizes = Sizes(worlds=8, lanes=(1, 2, 3), measure=1.0, train=2.0, parity_steps=3) if options.tiny else full
    if unknown := set(options.lanes or ()) - set(sizes.lanes):
        raise SystemExit(f"--lanes takes {sizes.lanes}, not {min(unknown)}.")
    envs, kinds = options.env or registry.names(), options.part or KINDS
    run(options.device, envs, kinds, sizes, options.out, options.again, options.lanes)


def chip(where: Found) -> str:
    """What all parts of a file are measured on: the GPU's name, or the device where it is none."""
    return where.get("gpu") or where["device"]


def run(
    device: str,
    envs: Sequence[str],
    kinds: Sequence[str],
    sizes: Sizes,
    out: Path,
    again: bool,
    lanes: Sequence[int] | None = None,
) -> None:
    """Measure every part that the file does not hold; train each number of lanes in `lanes`, or else in `sizes`."""
    found = read(out) or {"parts": {}}
    size = {"worlds_per_lane": sizes.worlds, "lanes": list(sizes.lanes)}
    here = attempt(machine, device)
    if "error" in here:
        raise SystemExit(f"Nothing can be measured on {device}: {here['error']}")
    if found["parts"] and found["size"] != size:
        raise SystemExit(f"{out} was measured with {found['size']}; name another file with --out.")
    if found["parts"] and chip(found["machine"]) != chip(here):
        raise SystemExit(f"{out} was measured on {chip(found['machine'])}; name another file with --out.")
    found |= {"date": today(), "machine": here, "size": size}
    repeated: set[str] = set()
    for name, part, extra in plan(envs, kinds, lanes or sizes.lanes, sizes, found):
        if _done(found, name) and not (again and name not in repeated):
            continue
        repeated.add(name)
        found["parts"][name] = attempt(part, name.split("/")[1], device, sizes, *extra)
        write(out, found)
        print(line(name, found["parts"][name]), flush=True)
    show(TITLES, *rows(found))


if __name__ == "__main__":
    sleep_when_idle()
    main()
