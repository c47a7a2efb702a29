"""Random sequences of faults: `python -m studies.random_faults`, or `make faults-random N=1000`.

Each seed is one flight; what the oracle objects to is printed with the seed, and makes the exit status 1.
"""

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from .flights import judge

AT_ONCE = {"simulated": 2, "mavlink": 4}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=1000, help="number of flights")
    parser.add_argument("--from", type=int, default=0, dest="first", help="first seed")
    parser.add_argument("--over", choices=AT_ONCE, default="simulated", help="simulated time, or MAVLink in real time")
    parser.add_argument("--jobs", type=int, default=0, help="flights at a time")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.n)
    print(f"seeds {seeds[0]} to {seeds[-1]}, {options.over}")
    answers: Counter[str] = Counter()
    wrong = begun = 0
    jobs = options.jobs or AT_ONCE[options.over]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for done in pool.map(judge, seeds, [options.over] * len(seeds)):
            begun += done.has_begun
            answers.update([f"{done.autopilot}: {', '.join(done.answers) or 'none'}"])
            if done.defects:
                wrong += 1
                print(
                    done.flown,
                    f"    ended: {done.ended}",
                    *(f"    DEFECT {d}" for d in done.defects),
                    sep="\n",
                    flush=True,
                )
    print(*(f"{count:5} {answer}" for answer, count in answers.most_common()), sep="\n")
    print(f"{len(seeds)} flights, {begun} of them begun, {wrong} with a defect")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
