#!/usr/bin/env python3
"""bags.py BENCH WORK: how fast recordings are read. BENCH is fxdyn_bag_bench. Makes 60 s of six joints at 500 Hz and an MCAP of
1 GB with images (tests/bags/writers), reads each in a process of its own, and prints seconds, MB/s and the process's largest
memory. The targets are the named constants.

  bags.py BENCH WORK [--megabytes N]
"""
import argparse
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
SECONDS = 60
TARGETS_S = {'zstd.mcap': 0.3, 'humble.db3': 0.3, 'truth.csv': 0.1}
LEAST_MB_S, MOST_MB = 200, 500


def measure(bench, file):
    done = subprocess.run([bench, file], capture_output=True, text=True, check=True)
    seconds, megabytes = map(float, done.stdout.split()[:2])
    return seconds, megabytes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('bench')
    parser.add_argument('work', type=pathlib.Path)
    parser.add_argument('--megabytes', type=int, default=1000)
    options = parser.parse_args()
    subprocess.run([HERE.parent / 'bags/writers/write.sh', options.work, str(SECONDS), str(options.megabytes)], check=True)
    folder, missed = options.work / 'bags', []
    for name, target in TARGETS_S.items():
        seconds, memory = min(measure(options.bench, folder / name) for _ in range(5))
        print(f'{name:<12} {seconds:6.3f} s (target {target} s), {memory:4.0f} MB')
        if seconds > target:
            missed.append(name)
    seconds, memory = min(measure(options.bench, folder / 'camera.mcap') for _ in range(3))
    size = (folder / 'camera.mcap').stat().st_size / 1e6
    print(f'camera.mcap  {seconds:6.3f} s for {size:.0f} MB: {size / seconds:.0f} MB/s (target {LEAST_MB_S}), {memory:.0f} MB (at most {MOST_MB})')
    if size / seconds < LEAST_MB_S or memory > MOST_MB:
        missed.append('camera.mcap')
    print('missed: ' + ', '.join(missed) if missed else 'all targets met')
    return 1 if missed else 0


if __name__ == '__main__':
    sys.exit(main())
