#!/usr/bin/env python3
"""sizes.py on sources made up for it."""
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import sizes


def function(lines, head='void f(int a)'):
    return head + ' {\n' + '  g();\n' * (lines - 2) + '}\n'


def found(files, allowed=''):
    with tempfile.TemporaryDirectory() as directory:
        root = pathlib.Path(directory)
        for name, text in files.items():
            path = root / 'host_tools' / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        (root / sizes.LIST).parent.mkdir(parents=True)
        (root / sizes.LIST).write_text(allowed)
        return sizes.complaints(root)


def names(text):
    return [(name, count) for name, _, count in sizes.functions_of(text)]


class Sizes(unittest.TestCase):
    def test_what_is_short_enough_is_right(self):
        self.assertEqual(found({'a/b.cpp': function(80) + '\n' * 420}), [])

    def test_a_long_function_is_named(self):
        self.assertEqual(found({'a/b.cpp': '\n' + function(81, 'int A::b(int c) const')}),
                         ['host_tools/a/b.cpp:2: A::b has 81 lines, more than 80'])

    def test_a_long_file_is_named(self):
        self.assertEqual(found({'a/b.hpp': '\n' * 501}),
                         ['host_tools/a/b.hpp: 501 lines, more than 500: give a part of it a file of its own'])

    def test_the_list_allows(self):
        files = {'a/b.cpp': function(81) + '\n' * 500}
        self.assertEqual(found(files, 'host_tools/a/b.cpp  # why\nhost_tools/a/b.cpp:f  # why\n'), [])

    def test_what_became_short_leaves_the_list(self):
        self.assertEqual(found({'a/b.cpp': function(80)}, 'host_tools/a/b.cpp:f\n'),
                         [f'{sizes.LIST}: host_tools/a/b.cpp:f is short enough: take it off'])

    def test_functions_of_classes_and_templates_are_seen(self):
        self.assertEqual(names('class A : B<int(3)> {\n int x() const {\n  return 1; }\n};\n'
                               'template <class T>\nauto g(T t) -> int {\n return 0;\n}\n'), [('x', 2), ('g', 4)])

    def test_a_constructor_counts_with_its_members(self):
        self.assertEqual(names('A::A(int b)\n    : b_(b),\n      c_{1} {\n  d();\n}\n'), [('A::A', 5)])

    def test_a_lambda_counts_for_its_function(self):
        self.assertEqual(names('void f() {\n  auto g = [&](int a) {\n    return a;\n  };\n}\n'), [('f', 5)])

    def test_tables_and_types_are_no_functions(self):
        self.assertEqual(names('constexpr int a[] = {\n1,\n2};\nstruct B {\n int c = f(1);\n};\nnamespace x {\n}\n'), [])

    def test_braces_in_texts_and_comments_do_not_count(self):
        self.assertEqual(names('void f() {\n  g("{", \'{\', R"({{)", 1\'000);  // {\n}\n'), [('f', 3)])


if __name__ == '__main__':
    unittest.main()
