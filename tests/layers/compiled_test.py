#!/usr/bin/env python3
"""compiled.py on output made up for it."""
import sys
import unittest

sys.dont_write_bytecode = True
import compiled

COMMANDS = """/usr/bin/c++ -I /root/a -o a/x.o -c /root/a/x.cpp
: && /usr/bin/c++ a/x.o -o x
/usr/bin/c++ -o b/y.o -c /root/b/y.cpp
"""
DEPS = """a/x.o: #deps 2, deps mtime 1 (VALID)
    ../../a/x.cpp
    ../../a/h.hpp

b/y.o: #deps 3, deps mtime 1 (VALID)
    ../../b/y.cpp
    ../../a/h.hpp
    ../../a/other_h.hpp
"""


class Compiled(unittest.TestCase):
    def test_links_are_no_compiles(self):
        self.assertEqual(compiled.for_target(COMMANDS), 2)

    def test_objects_that_read_a_header(self):
        self.assertEqual(compiled.after_change(DEPS, 'a/h.hpp'), {'a': 1, 'b': 1})
        self.assertEqual(compiled.after_change(DEPS, 'a/other_h.hpp'), {'b': 1})

    def test_a_source_is_read_by_its_own_object(self):
        self.assertEqual(compiled.after_change(DEPS, 'b/y.cpp'), {'b': 1})

    def test_a_file_is_the_end_of_a_path(self):
        self.assertEqual(compiled.after_change(DEPS, 'h.hpp'), {'a': 1, 'b': 1})
        self.assertEqual(compiled.after_change(DEPS, 'r_h.hpp'), {})


if __name__ == '__main__':
    unittest.main()
