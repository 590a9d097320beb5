"""Make texts from outside safe to show: no control character, escape sequence or line break reaches a terminal."""


def printable(text: str) -> str:
    """Return a text as one line of printable characters, all others escaped as in Python: `\\x1b`, `\\n`, `\\u202e`.

    Printable are the characters that `str.isprintable` names; control and format characters, all spaces but the
    common one, and halves of surrogate pairs are not.
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode("ascii") for each in text)
