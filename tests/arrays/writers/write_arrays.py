#!/usr/bin/python3
"""write_arrays.py FOLDER [SECONDS]: one motion as truth.csv and as files of MATLAB and HDF5, by SciPy and h5py (Debian's python3-scipy and
python3-h5py, which setup.sh does not install: tests read what this has written into tests/arrays/files). With SECONDS: the files of
tests/bench/arrays.py, six joints at 500 Hz."""
import json
import pathlib
import sys

import h5py
import numpy as np
import scipy.io
import scipy.sparse


def motion(samples, joints):
    """t, q, dq, tau: numbers that fill all bits of a double"""
    t = np.arange(samples) * 0.002 + 0.25
    phase = np.outer(t, 1.5 + 0.4 * np.arange(joints))
    return t, np.sin(phase), (1.5 + 0.4 * np.arange(joints)) * np.cos(phase), 10 * np.cos(2 * phase) + np.sin(7 * phase)


def write_truth(file, t, q, dq, tau):
    joints = range(1, q.shape[1] + 1)
    names = ['t'] + [f'{signal}{j}' for signal in ('q', 'dq', 'tau') for j in joints]
    np.savetxt(file, np.column_stack([t, q, dq, tau]), delimiter=',', header=','.join(names), comments='', fmt='%.17g')


def write_matlab(folder, t, q, dq, tau):
    def save(name, content, **options):
        scipy.io.savemat(folder / name, content, **options)

    samples = len(t)
    save('plain.mat', {'t': t, 'q': q, 'dq': dq, 'tau': tau})
    save('rows.mat', {'t': t, 'q': q.T, 'dq': dq.T, 'tau': tau.T}, do_compression=True, oned_as='column')
    save('old.mat', {'t': t, 'q': q, 'dq': dq, 'tau': tau}, format='4')
    save('struct.mat', {'log': {'time': t, 'q': q, 'qd': dq, 'torque': tau.T}, 'note': 'a run'}, do_compression=True)
    save('columns.mat', {'t': t, **{f'{name}{j + 1}': value[:, j] for name, value in (('q', q), ('dq', dq), ('tau', tau)) for j in (0, 1)}})
    save('types.mat', {'t_ms': np.arange(samples, dtype=np.int32) * 2, 'q': q.astype(np.float32), 'tau': np.round(tau * 1000).astype(np.int16)})
    structure = {name: {'time': t, 'signals': {'values': value, 'dimensions': 2, 'label': ''}, 'blockName': 'arm/' + name}
                 for name, value in (('q', q), ('dq', dq), ('tau', tau.T[:, None, :]))}
    save('simulink.mat', structure, do_compression=True)
    signals = np.zeros((1, 3), dtype=[('values', 'O'), ('dimensions', 'O'), ('label', 'O')])
    for k, (name, value) in enumerate((('q', q), ('dq', dq), ('tau', tau))):
        signals[0, k] = (value, 2.0, name)
    save('scope.mat', {'scope': {'time': t, 'signals': signals, 'blockName': 'arm/Scope'}})
    structure['tau']['time'] = t + 0.001
    save('two_times.mat', structure, do_compression=True)
    save('two_logs.mat', {name: {'t': t, 'q': q, 'dq': dq, 'tau': tau} for name in ('first', 'second')}, do_compression=True)
    bad = {'t': t, 'q': q, 'tau': tau}
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = q[:, 0], q[:, 1]
    save('cell.mat', {**bad, 'q': cells}, do_compression=True)
    save('sparse.mat', {**bad, 'tau': scipy.sparse.csc_matrix(tau)}, do_compression=True)
    save('complex.mat', {**bad, 'q': q + 1j}, do_compression=True)
    save('shape.mat', {**bad, 'tau': tau[:-1]}, do_compression=True)
    save('no_time.mat', {'q': q, 'tau': tau, 'robot': 'arm'}, do_compression=True)
    hole, tail = tau.copy(), [value.copy() for value in (t, q, tau)]
    hole[20, 1] = np.nan
    save('nan.mat', {**bad, 'tau': hole}, do_compression=True)
    for value in tail:
        value[-5:] = np.nan
    save('unfilled.mat', dict(zip(('t', 'q', 'tau'), tail)), do_compression=True)
    back = t.copy()
    back[-3:] = 0
    save('zeros.mat', {**bad, 't': back}, do_compression=True)


def write_hdf5(folder, t, q, dq, tau):
    def save(name, content, attributes=None, libver=None, **options):
        with h5py.File(folder / name, 'w', libver=libver, track_order=False) as file:
            for key, value in content.items():
                file.create_dataset(key, data=value, **(options if np.ndim(value) else {}))
            for group, (key, value) in (attributes or {}).items():
                file[group].attrs[key] = value

    plain = {'t': t, 'q': q, 'dq': dq, 'tau': tau}
    save('plain.h5', plain)
    save('packed.hdf5', plain, chunks=True, compression='gzip', shuffle=True, fletcher32=True, libver='latest')
    save('rows.h5', {'t': t, 'q': q.T, 'dq': dq.T, 'tau': tau.T}, chunks=True, compression='gzip', libver='latest')
    save('group.h5', {'run/t': t, **{f'run/{name}{j + 1}': value[:, j] for name, value in (('q', q), ('dq', dq), ('tau', tau)) for j in (0, 1)},
                      'about': np.bytes_('a run')})
    save('big_endian.h5', {key: value.astype('>f8') for key, value in plain.items()})
    demos = {}
    for k in (2, 10):
        demos.update({f'data/demo_{k}/actions': tau, f'data/demo_{k}/obs/q': q + k, f'data/demo_{k}/obs/tau': tau})
    demos['data/demo_2/obs/image'] = np.zeros((len(t), 4, 4, 3), np.uint8)
    save('robomimic.hdf5', demos, {'data': ('env_args', json.dumps({'env_name': 'Lift', 'env_kwargs': {'control_freq': 20}}))})
    save('no_rate.hdf5', {'data/demo_0/obs/q': q, 'data/demo_0/actions': tau})
    save('lzf.h5', {'t': t, 'q': q, 'tau': tau}, chunks=True, compression='lzf', libver='latest')
    save('complex.h5', {**plain, 'q': q + 1j})
    records = np.zeros(len(t), dtype=[('t', 'f8'), ('q', 'f8', 2), ('tau', 'f8', 2)])
    save('records.h5', {'log': records}, compression='gzip')
    save('text.h5', {**plain, 'tau': np.array([b'1.0'] * len(t))})


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    if len(sys.argv) == 2:
        signals = motion(60, 2)
        write_truth(folder / 'truth.csv', *signals)
        write_matlab(folder, *signals)
        write_hdf5(folder, *signals)
        return
    t, q, dq, tau = motion(int(float(sys.argv[2]) * 500), 6)
    write_truth(folder / 'truth.csv', t, q, dq, tau)
    content = {'t': t, 'q': q, 'dq': dq, 'tau': tau}
    scipy.io.savemat(folder / 'plain.mat', content)
    scipy.io.savemat(folder / 'packed.mat', {'log': content}, do_compression=True)
    for name, options in (('plain.h5', {}), ('packed.h5', {'chunks': True, 'compression': 'gzip'})):
        with h5py.File(folder / name, 'w') as file:
            for key, value in content.items():
                file.create_dataset(key, data=value, **options)


if __name__ == '__main__':
    main()
