#!/usr/bin/env python3
"""arrays.py BENCH WORK: how fast files of MATLAB and HDF5 are read. BENCH is fxdyn_bag_bench. Makes 60 s of six joints at 500 Hz
(tests/arrays/writers, which needs Debian's python3-scipy and python3-h5py), reads each in a process of its own, and prints seconds, of
them those of the processor, and that process's largest memory. The target is the named constant."""
import pathlib
import resource
import subprocess
import sys

import bags

HERE = pathlib.Path(__file__).resolve().parent
TARGET_S = 0.3


def processor_s():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def measure(bench, file):
    """Least of five: seconds, processor's seconds; memory."""
    runs = []
    for _ in range(5):
        before = processor_s()
        seconds, memory = bags.measure(bench, file)
        runs.append((seconds, processor_s() - before, memory))
    return tuple(map(min, zip(*runs)))


def main():
    bench, work = sys.argv[1], pathlib.Path(sys.argv[2])
    subprocess.run([HERE.parent / 'arrays/writers/write_arrays.py', work, str(bags.SECONDS)], check=True)
    missed = []
    for name in ('plain.mat', 'packed.mat', 'plain.h5', 'packed.h5'):
        seconds, processor, memory = measure(bench, work / name)
        print(f'{name:<12} {seconds:6.3f} s (target {TARGET_S} s), processor {processor:.3f} s, {memory:4.0f} MB')
        if seconds > TARGET_S:
            missed.append(name)
    print('missed: ' + ', '.join(missed) if missed else 'all targets met')
    return 1 if missed else 0


if __name__ == '__main__':
    sys.exit(main())
