"""A plan says in one sentence which explanations no run tells apart."""

from pamid.report.next_run import _classes


def test_explanations_of_which_every_two_are_alike_are_one_class():
    a, b, c, d = (("bias@u",), ("bias@v",), ("friction@q",), ("lag@u",))
    assert _classes([]) == [] and _classes([(a, b)]) == [[a, b]]
    assert _classes([(a, b), (a, c), (b, c)]) == [[a, b, c]]
    assert _classes([(a, b), (b, c), (c, d), (b, d)]) == [[a, b], [b, c, d]]
