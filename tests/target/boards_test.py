#!/usr/bin/env python3
"""boards.py on trees made up for it."""
import json
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import boards

LINE = 'demo-1  demo  demo_folder  cortex-m4  demo.ld  -  node  node=main_demo.cpp,tick_handler\n'
FILES = ('hal/demo_folder/startup.cpp', 'toolchains/linker/demo.ld', 'firmware/main_demo.cpp')


def found(line=LINE, files=FILES, preset='demo', budget='2026-01-01,demo-1,node,6\n'):
    with tempfile.TemporaryDirectory() as directory:
        root = pathlib.Path(directory)
        presets = {'configurePresets': [{'name': preset, 'cacheVariables': {'FXDYN_CPU': preset}}],
                   'buildPresets': [{'name': preset, 'configurePreset': preset}]}
        contents = {file: '' for file in files} | {'toolchains/boards.txt': '# a comment\n' + line, 'firmware/budget.csv': budget,
                                                   'CMakePresets.json': json.dumps(presets)}
        for name, text in contents.items():
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return boards.complaints(root)


class Boards(unittest.TestCase):
    def test_a_board_that_brings_everything(self):
        self.assertEqual(found(), [])

    def test_each_missing_file_is_named(self):
        for file in FILES:
            self.assertEqual(found(files=[f for f in FILES if f != file]), [f'{file}: missing, demo-1 needs it'])

    def test_a_missing_preset_is_written_out(self):
        lines = found(preset='other')
        self.assertIn('{"name": "demo", "inherits": "arm", "cacheVariables": {"FXDYN_CPU": "demo"}}', lines[0])
        self.assertIn('other is no preset of', lines[1])

    def test_what_is_measured_has_a_budget(self):
        self.assertEqual(found(budget=''), ['firmware/budget.csv: no row for demo-1, node: tests/target/budget.sh adds it'])

    def test_an_unknown_test_is_named(self):
        self.assertIn('no test "nodes"', found(line=LINE.replace(' node ', ' nodes '))[0])


if __name__ == '__main__':
    unittest.main()
