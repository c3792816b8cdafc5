#!/usr/bin/env python3
"""parquet.py BENCH WORK: how fast Parquet is read. BENCH is fxdyn_bag_bench. Makes 60 s of six joints at 500 Hz as Arrow's Rust and
hyparquet-writer write them (tests/arrays/writers), the same with an image in each row, and 600 s. Reads each in a process of its own, and
prints seconds, of them those of the processor, and that process's largest memory. The target is the named constant."""
import pathlib
import subprocess
import sys

import arrays
import bags

HERE = pathlib.Path(__file__).resolve().parent
TARGET_S = 0.3
IMAGE_KB = 8


def main():
    bench, work = sys.argv[1], pathlib.Path(sys.argv[2])
    write = HERE.parent / 'arrays/writers/write_parquet.sh'
    subprocess.run([write, work, work / 'short', str(bags.SECONDS), str(IMAGE_KB)], check=True)
    subprocess.run([write, work, work / 'long', str(10 * bags.SECONDS)], check=True)
    missed = []
    for name in ('short/plain', 'short/snappy', 'short/zstd', 'short/hyparquet', 'short/camera', 'long/snappy'):
        file = work / f'{name}.parquet'
        seconds, processor, memory = arrays.measure(bench, file)
        print(f'{name:<16} {seconds:6.3f} s (target {TARGET_S} s), processor {processor:.3f} s, {memory:4.0f} MB, '
              f'file {file.stat().st_size / 1e6:.1f} MB')
        if seconds > TARGET_S and name.startswith('short'):
            missed.append(name)
    print('missed: ' + ', '.join(missed) if missed else 'all targets met')
    return 1 if missed else 0


if __name__ == '__main__':
    sys.exit(main())
