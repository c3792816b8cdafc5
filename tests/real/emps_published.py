#!/usr/bin/env python3
"""Models of EMPS with the parameters that its authors published, for `fxdyn forward`.

  emps_published.py NOMINAL.json OUT_FOLDER     writes symmetric.json and asymmetric.json

A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019. All but the parameters is the model of `fxdyn run tests/real/emps.toml` before diagnosis.
"""
import copy
import json
import pathlib
import sys

MASS, VISCOUS, COULOMB, OFFSET = 95.1089, 203.5034, 20.3935, -3.1648  # kg, N*s/m, N, N
# With friction of its own in each direction: no offset.
ASYMMETRIC_MASS, PLUS, MINUS = 95.1540, (166.7061, 20.1440), (240.4236, 20.6277)


def with_parameters(nominal, mass, viscous, coulomb, offset):
    model = copy.deepcopy(nominal)
    model['base_parameters'][0]['value'] = model['inertia'][0][0] = mass
    values = {'viscous': viscous, 'coulomb': coulomb, 'offset': offset}
    for effect in model['joints'][0]['effects']:
        effect['parameters'][0]['value'] = values[effect['effect']]
    return model


def main():
    nominal = json.loads(pathlib.Path(sys.argv[1]).read_text())
    out = pathlib.Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    symmetric = with_parameters(nominal, MASS, VISCOUS, COULOMB, OFFSET)
    # Half of the sum is in `viscous` and `coulomb`, half of the difference in `asymmetric_friction`.
    half = [[0.5 * (a + sign * b) for a, b in zip(PLUS, MINUS)] for sign in (1, -1)]
    asymmetric = with_parameters(nominal, ASYMMETRIC_MASS, *half[0], 0)
    asymmetric['joints'][0]['effects'].append(
        {'effect': 'asymmetric_friction', 'origin': 'nominal',
         'parameters': [{'name': 'coulomb', 'unit': 'N', 'value': half[1][1]},
                        {'name': 'viscous', 'unit': 'N*s/m', 'value': half[1][0]}]})
    for name, model in (('symmetric', symmetric), ('asymmetric', asymmetric)):
        (out / f'{name}.json').write_text(json.dumps(model))
    return 0


if __name__ == '__main__':
    sys.exit(main())
