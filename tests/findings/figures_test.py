#!/usr/bin/env python3
"""figures.py on pages and results made up for it."""
import argparse
import contextlib
import io
import json
import pathlib
import sys
import tempfile
import unittest
import unittest.mock

sys.dont_write_bytecode = True
import figures

PAGE = """# A page
| method | error, % | N m |
|---|---|---|
| other | 9.1 | 3 |
## Results
| method | error, % | N m |
|---|---|---|
| rigid | 9.19 | 6.57 |
| **named** | **0.029** | 1.1e-6 |

The ratio is 0.54, of 3 joints.
"""
# The place of `program` is taken by a script that writes a result.
LIST = """
[[project]]
name = "toy"
commands = ["{out}"]
{more_project}
[[figure]]
page = "page.md"
project = "toy"
{place}
file = "result.json"
path = "{path}"
better = "{better}"
{more}
"""
CELL = 'table = "## Results"\nrow = "named"\ncolumn = "error, %"'
RESULT = {'methods': [{'name': 'rigid', 'percent': 9.19, 'rmse': [1, 2]}, {'name': 'named', 'percent': 0.029, 'rmse': [3, 5]}]}
PERCENT = 'methods[name=named].percent'


class Toy:
    """A folder with a page, a list, and a program that writes `result`."""

    def __init__(self, folder, result=None, place=CELL, path=PERCENT, better='less', more='', more_project='', code=0):
        self.root = pathlib.Path(folder)
        (self.root / 'page.md').write_text(PAGE)
        (self.root / 'list.toml').write_text(
            LIST.format(out='{out}', place=place, path=path, better=better, more=more, more_project=more_project))
        program = self.root / 'program'
        program.write_text(f"#!/bin/sh\necho made\ncat >\"$1/result.json\" <<'E'\n{json.dumps(result or RESULT)}\nE\nexit {code}\n")
        program.chmod(0o755)
        self.options = argparse.Namespace(list=self.root / 'list.toml', work=self.root / 'work', program=str(program),
                                          only=None, short=False, keep=False, update=False, check=False)

    def run(self, **options):
        vars(self.options).update(options)
        self.out, self.err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(self.out), contextlib.redirect_stderr(self.err):
            return figures.run(self.options, self.root)

    def page(self):
        return (self.root / 'page.md').read_text()


def with_percent(value):
    return {'methods': [RESULT['methods'][0], {**RESULT['methods'][1], 'percent': value}]}


class Figures(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def toy(self, **arguments):
        return Toy(self.folder.name, **arguments)

    def test_a_figure_that_is_as_written_passes(self):
        toy = self.toy()
        self.assertEqual(toy.run(), 0)
        self.assertIn('0.029', toy.out.getvalue())

    def test_what_the_page_rounds_is_no_worse(self):
        self.assertEqual(self.toy(result=with_percent(0.0294)).run(), 0)

    def test_a_worse_figure_fails(self):
        toy = self.toy(result=with_percent(0.0297))
        self.assertEqual(toy.run(), 1)
        self.assertIn('WORSE', toy.out.getvalue())
        self.assertIn('worse than written', toy.err.getvalue())

    def test_a_better_figure_passes_unless_it_has_to_be_the_same(self):
        better = with_percent(0.02)
        self.assertEqual(self.toy(result=better).run(), 0)
        self.assertEqual(self.toy(result=better, better='same').run(), 1)
        self.assertEqual(self.toy(result=better, better='more').run(), 1)
        self.assertEqual(self.toy(result=with_percent(0.04), better='more').run(), 0)

    def test_slack_is_a_share_and_needs_its_reason(self):
        self.assertEqual(self.toy(result=with_percent(0.031), more='slack = 0.1\nreason = "the machine"').run(), 0)
        self.assertEqual(self.toy(result=with_percent(0.033), more='slack = 0.1\nreason = "the machine"').run(), 1)
        with self.assertRaisesRegex(figures.Wrong, 'needs its reason'):
            self.toy(more='slack = 0.1').run()
        with self.assertRaisesRegex(figures.Wrong, 'below 1'):
            self.toy(more='slack = 5\nreason = "much"').run()

    def test_a_figure_that_is_not_on_the_page_fails(self):
        for place in ('row = "nobody"\ncolumn = "error, %"', 'row = "named"\ncolumn = "seconds"', 'after = "not there"',
                      'table = "## Elsewhere"\nrow = "named"\ncolumn = "error, %"', 'after = "e"'):
            toy = self.toy(place=place)
            self.assertEqual(toy.run(), 1, place)
            self.assertEqual(self.toy(place=place).run(check=True), 1, place)

    def test_check_runs_nothing(self):
        toy = self.toy(result=with_percent(7))
        self.assertEqual(toy.run(check=True), 0)
        self.assertFalse((toy.root / 'work').exists())

    def test_the_table_after_its_heading_is_read(self):
        first = 'row = "rigid"\ncolumn = "error, %"'
        self.assertEqual(self.toy(place=first, path='methods[name=rigid].percent').run(), 0)
        self.assertEqual(self.toy(place='row = "other"\ncolumn = "error, %"', path='methods[name=rigid].percent').run(), 1)

    def test_without_a_row_the_first_one_is_read(self):
        first = 'table = "## Results"\ncolumn = "N m"'
        self.assertEqual(self.toy(place=first, path='methods[name=named].rmse[0]').run(), 0)  # 3 <= 6.57
        self.assertEqual(self.toy(place=first, path='methods[name=rigid].percent').run(), 1)  # 9.19 > 6.57

    def test_text_and_the_number_after_it(self):
        self.assertEqual(self.toy(place='after = "ratio is"', path='methods[name=named].rmse[0]',
                                  more='over = "methods[name=named].rmse[1]"').run(), 1)  # 0.6
        self.assertEqual(self.toy(place='after = "ratio is"\nnumber = 2', path='methods[name=named].rmse[0]').run(), 0)
        self.assertEqual(self.toy(place='after = "ratio is"\nnumber = 2', path='max(methods[*].rmse[0])').run(), 0)
        self.assertEqual(self.toy(place='after = "ratio is"\nnumber = 3', path='methods[name=named].rmse[0]').run(), 1)

    def test_paths(self):
        self.assertEqual(figures.value_at(RESULT, 'mean(methods[name=named].rmse[*])'), 4)
        self.assertEqual(figures.value_at(RESULT, 'count(methods[*])'), 2)
        self.assertAlmostEqual(figures.value_at(RESULT, 'geomean(methods[*].rmse[1])'), 10 ** 0.5)
        self.assertEqual(figures.value_at([{'seconds': 5.0, 'x': 1}, {'seconds': 10, 'x': 2}], '[seconds=5].x'), 1)
        for path in ('methods[name=nobody].percent', 'methods[*].percent', 'methods[name=named].name', 'metods', 'methods[7]'):
            with self.assertRaises(figures.Wrong, msg=path):
                figures.value_at(RESULT, path)
        with self.assertRaises(figures.Wrong):
            figures.value_at({'x': None}, 'x')

    def test_figures_of_a_column_and_of_a_row(self):
        group = '[[figures]]\npage = "page.md"\nproject = "toy"\ntable = "## Results"\nfile = "result.json"\nbetter = "less"\n'
        toy = self.toy()
        for more, complaints in (('column = "error, %"\nrows = { rigid = "methods[name=rigid].percent", '
                                  'named = "methods[name=rigid].percent" }', 1),
                                 ('row = "rigid"\ncolumns = { "error, %" = "methods[name=rigid].percent", '
                                  '"N m" = "methods[name=named].rmse[1]" }', 0)):
            (toy.root / 'list.toml').write_text('[[project]]\nname = "toy"\ncommands = ["{out}"]\n' + group + more)
            self.assertEqual(toy.run(), complaints, more)
            self.assertEqual(toy.out.getvalue().count('page: '), 2)
        cells = ('rows = { rigid = "methods[name=rigid]", named = "methods[name=named]" }\n'
                 'columns = { "error, %" = ".percent", "N m" = ".rmse[1]" }')
        (toy.root / 'list.toml').write_text('[[project]]\nname = "toy"\ncommands = ["{out}"]\n' + group + cells)
        self.assertEqual(toy.run(), 1)  # 5 N m of `named` are worse than 1.1e-6
        self.assertEqual(toy.out.getvalue().count('page: '), 4)
        (toy.root / 'list.toml').write_text('[[project]]\nname = "toy"\ncommands = ["{out}"]\n' + group)
        with self.assertRaisesRegex(figures.Wrong, 'rows or columns'):
            toy.run()

    def test_a_result_that_is_missing_fails(self):
        self.assertEqual(self.toy(path='methods[name=nobody].percent').run(), 1)
        self.assertEqual(self.toy(more='over = "nothing"').run(), 1)

    def test_a_program_that_fails_fails(self):
        toy = self.toy(code=2)
        self.assertEqual(toy.run(), 1)
        self.assertIn('made', toy.err.getvalue())

    def test_update_writes_the_page(self):
        toy = self.toy(result=with_percent(0.0351))
        self.assertEqual(toy.run(update=True), 0)
        self.assertEqual(toy.page(), PAGE.replace('**0.029**', '**0.035**'))
        self.assertEqual(toy.run(update=False), 0)

    def test_numbers_keep_their_digits(self):
        self.assertEqual(figures.as_written(1.234e-7, '1.1e-6'), '1.2e-7')
        self.assertEqual(figures.as_written(12.345, '9.19'), '12.35')
        self.assertEqual(figures.as_written(127.4, '131'), '127')
        self.assertEqual(figures.as_written(0.0123, '0.5'), '0.012')

    def test_only_some_projects(self):
        self.assertEqual(self.toy(result=with_percent(7)).run(short=True), 0)
        self.assertEqual(self.toy(result=with_percent(7), more_project='short = true').run(short=True), 1)
        with self.assertRaisesRegex(figures.Wrong, 'no project none'):
            self.toy().run(only='none')

    def test_measured_data_that_was_named_and_is_missing_fails(self):
        with unittest.mock.patch.dict(figures.os.environ, {'FXDYN_DATA': self.folder.name}):
            self.assertEqual(self.toy(more_project='data = "robot"').run(), 1)
        with unittest.mock.patch.dict(figures.os.environ), \
                unittest.mock.patch.object(figures, 'ROOT', pathlib.Path(self.folder.name) / 'a'):
            figures.os.environ.pop('FXDYN_DATA', None)
            toy = self.toy(more_project='data = "robot"')
            self.assertEqual(toy.run(), 0)
            self.assertIn('skipped', toy.out.getvalue())
            # other sets are there: this one must not be missing unseen
            figures.data_folder().mkdir(parents=True)
            self.assertEqual(self.toy(more_project='data = "robot"').run(), 1)

    def test_a_wrong_list_is_said(self):
        for place, why in (('row = "x"', 'row and column, or after'), (CELL + '\ncolour = 1', 'unknown key')):
            with self.assertRaisesRegex(figures.Wrong, why):
                self.toy(place=place).run()
        with self.assertRaisesRegex(figures.Wrong, 'better ='):
            self.toy(better='nicer').run()


if __name__ == '__main__':
    unittest.main()
