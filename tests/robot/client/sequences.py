"""Input of terminals that is no letter."""

ARROWS = {b"\x1b[A": "up", b"\x1bOB": "down", b"\x1b[C": "right", b"\x1bOD": "left"}

UNKNOWN = (
    # Keys with Ctrl, Shift and Alt, of xterm, rxvt, the Linux console and PuTTY.
    *(b"\x1b[1;%d%c" % (mods, key) for mods in range(2, 9) for key in b"ABCDEFHPQRS"),
    *(b"\x1b%c" % key for key in b"abcdefghijklmnopqrstuvwxyzADEPRMUX+-=\r\t\x7f"),
    *(b"\x1bO%c" % key for key in b"abcdEFHIMPQRSjklmnopqrstuvwxyX"),
    *(b"\x1bO5%c" % key for key in b"ABCDPQRS"),
    *(b"\x1b[%c" % key for key in b"abcdEFHIOPQSZ"),
    *(b"\x1b[[%c" % key for key in b"ABCDE"),
    *(b"\x1b[%d~" % key for key in range(1, 35)),
    *(b"\x1b[%d;5~" % key for key in range(1, 35)),
    *(b"\x1b[%d^" % key for key in range(2, 9)),
    # kitty's protocol and xterm's modifyOtherKeys: W, A, S, D, E and P, pressed and released.
    *(b"\x1b[%du" % key for key in b"wasdep"),
    *(b"\x1b[%d;1:3u" % key for key in b"wasdep \x1b"),
    *(b"\x1b[27;5;%d~" % key for key in b"wasdep"),
    b"\x1b[?31u",
    # Mouse, focus, and replies to questions that another program asked.
    b"\x1b[<0;12;34M",
    b"\x1b[<0;12;34m",
    b"\x1b[32;12;34M",
    b"\x1b[M#we",
    b"\x1b[M`\xc3\xa9e",
    b"\x1b[twe",
    b"\x1b[Twasdep",
    b"\x1b[I",
    b"\x1b[O",
    b"\x1b[?64;1;2c",
    b"\x1b[>41;354;0c",
    b"\x1b[24;80R",
    b"\x1b[8;24;80t",
    b"\x1b]11;rgb:dddd/eeee/aaaa\x07",
    b"\x1b]11;rgb:dddd/eeee/aaaa\x1b\\",
    b"\x1b]52;c;d2FzZGVw\x1b\\",
    b"\x1bP1$r0;1w\x1b\\",
    b"\x1bP>|xterm(385)\x07wasdep\x1b\\",
    b"\x1b_Gi=31;wasdep\x1b\\",
    b"\x1b^wasdep\x1b\\",
    b"\x1bXwasdep\x1b\\",
    b"\x1b(w",
    b"\x1b(A",
    # Controls of eight bits, raw and as UTF-8.
    b"\x9b1;5D",
    b"\x9b[A",
    b"\x8fP",
    b"\x9d11;wasdep\x9c",
    b"\x90wasdep\xc2\x9c",
    b"\xc2\x9b1;5D",
    b"\xc2\x9d0;wasdep\x07",
    # Characters, control characters and other encodings: e with an accent, W in Cyrillic, "e" as
    # the second byte of Shift JIS and GBK.
    "\N{LATIN SMALL LETTER E WITH ACUTE}".encode(),
    "\N{CYRILLIC SMALL LETTER TSE}".encode(),
    "\N{AUTOMOBILE}".encode(),
    b"\x83e",
    b"\xc4e",
    *(bytes([code]) for code in range(1, 27) if code not in b"\r\n"),
    # Pasted text.
    b"\x1b[200~wasd\rep\x1b[201~",
)
