"""Oddities of controllers' files, one at a time, by hand after public programs and manuals; none is copied.

Each is a piece of a file and what must come of it: the positions as written by their names, or a told reason.
"""

from collections.abc import Callable
from typing import NamedTuple

Expected = dict[str, tuple[float, ...]] | str
P = (1.0, 2.0, 3.0, 10.0, 20.0, 30.0)
Z = (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)


class Dialect(NamedTuple):
    """Of a brand: the file's name, what stands around a piece, and the pieces with what must come of them."""

    name: str
    around: Callable[[str], str]
    pieces: list[tuple[str, Expected]]


def _plain(text: str) -> str:
    return text + "\n"


_X = "X 1,Y 2,Z 3,A 10,B 20,C 30"
KUKA = Dialect("a.dat", lambda body: f"DEFDAT a\n{body}\nENDDAT\n", [
    (f"DECL E6POS XP1={{{_X},S 2,T 3,E1 0.0}}", {"XP1": P}),
    (f"DECL GLOBAL E6POS XP1={{{_X}}}", {"XP1": P}),
    (f"GLOBAL E6POS XP1={{{_X}}}", {"XP1": P}),
    (f"E6POS XP1 = {{ {_X} }}", {"XP1": P}),
    (f"decl e6pos xp1={{{_X.lower()}}}", {"xp1": P}),
    (f"DECL POS XP1={{{_X},S 6,T 50}}", {"XP1": P}),
    (f"DECL FRAME PLACE={{{_X}}}", {"PLACE": P}),
    (f"DECL E6POS XP1={{E6POS: {_X}}}", {"XP1": P}),
    ("DECL E6POS XP1={C 30,B 20,A 10,Z 3,Y 2,X 1}", {"XP1": P}),
    ("DECL E6POS XP1={X 1.0E+00,Y 2.00000000,Z 3.0,A 1.0e1,B 20,C 3.0E01}", {"XP1": P}),
    ("DECL E6POS XP1={X +1,Y 2.,Z 3,A 10,B 20,C 30}", {"XP1": P}),
    (f"DECL E6POS XP1={{{_X}}} ; {{X 9,Y 9}}", {"XP1": P}),
    (f"; DECL E6POS XP0={{X 9,Y 9,Z 9,A 0,B 0,C 0}}\nDECL E6POS XP1={{{_X}}}", {"XP1": P}),
    (f"POINTS[3]={{{_X}}}", {"POINTS[3]": P}),
    (f'DECL E6POS XP1={{{_X}}}\nDECL BASIS_SUGG_T LAST_BASIS={{POINT1[] "P1",CONT[] "C_PTP"}}', {"XP1": P}),
    (f"DECL PDAT PPDAT1={{VEL 100.0,ACC 99.0,APO_MODE #CPTP}}\nDECL E6POS XP1={{{_X}}}", {"XP1": P}),
    (f"DECL E6POS XP1={{{_X}}}\nDECL E6POS XP1={{{_X}}}", {"XP1": P}),
    (f"DECL E6POS XP1={{{_X}}}\nDECL E6POS XP1={{{_X.replace('3,', '4,')}}}", "other numbers"),
    ("DECL E6POS XP1={X 1,Y 2,Z 3}", "A, B, C missing"),
    ("DECL E6POS XP1={X 1,Y 2,Z 3,A 10,B 20,C 30", "brackets do not match"),
    ("DECL E6POS XP1={X 1,X 1,Y 2,Z 3,A 10,B 20,C 30}", "stands there twice"),
    ("DECL E6POS XP1={X 1,Y 2,Z 3,A 10,B 20,C ***}", "no number"),
    ("DECL E6POS XP1={X 1,Y 2,Z 3,A 10;B 20,C 30}", "brackets do not match"),
    (f"DECL E6POS XP1={{{_X}}}\nDECL FDAT FP1={{TOOL_NO 1,BASE_NO 3,IPO_FRAME #TCP}}", "stands still"),
    (f"DECL E6POS XP1={{{_X}}}\nDECL FDAT FP1={{TOOL_NO 4,BASE_NO 0,IPO_FRAME #BASE}}", "tool 4"),
    ("E6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0}", "joints alone"),
])  # fmt: skip

_T = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
_A = (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0)
ABB = Dialect("a.mod", lambda body: f"MODULE a\n{body}\nENDMODULE\n", [
    (f"CONST robtarget p1:={_T};", {"p1": _A}),
    (f"PERS robtarget p1:={_T};", {"p1": _A}),
    (f"VAR robtarget p1 := {_T} ;", {"p1": _A}),
    (f"LOCAL CONST robtarget p1:={_T};", {"p1": _A}),
    (f"TASK PERS robtarget p1:={_T};", {"p1": _A}),
    (f"const ROBTARGET p1:={_T};", {"p1": _A}),
    (f"CONST robtarget p1:=\n  {_T.replace('],[', '],' + chr(10) + '  [')};", {"p1": _A}),
    (f"CONST robtarget p1:={_T.replace('9E9', '9E+09')};", {"p1": _A}),
    (f"CONST robtarget p1:={_T.replace('9E9', '9e9')};", {"p1": _A}),
    (f"CONST robtarget p1:={_T.replace('[1,2,3]', '[1.0E0, 2., +3]')};", {"p1": _A}),
    (f"CONST robtarget p1:={_T}; ! taught ; again", {"p1": _A}),
    (f"! CONST robtarget p0:={_T};\nCONST robtarget p1:={_T};", {"p1": _A}),
    (f"CONST robtarget p1{{1}}:=[{_T}];", {"p1{1}": _A}),
    (f"PROC m()\nMoveL {_T},v5,fine,tool0\\WObj:=wobj0;\nENDPROC", {"line 3": _A}),
    (f"PROC m()\nMoveL {_T}\\ID:=1,v5,fine,tool0;\nENDPROC", {"line 3": _A}),
    (f"%%%\n VERSION:1\n LANGUAGE:ENGLISH\n%%%\nCONST robtarget p1:={_T};", {"p1": _A}),
    (f"CONST robtarget p1:={_T};\nCONST robtarget P1:={_T.replace('1,2', '7,2')};", "other numbers"),
    ("CONST robtarget p1:=[[1,2,3],[1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", "p1"),
    ("CONST robtarget p1:=[[1,2,3],[2,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", "unit quaternion"),
    ("CONST robtarget p1:=[[1,2,3],[1,0,0,0],[0,0,0,0];", "p1"),
    ("VAR robtarget p1;", "no value"),
    (f"PROC m()\nMoveL Offs({_T},0,0,1),v5,fine,tool0;\nENDPROC", "calculated"),
    (f"CONST robtarget p1:={_T};\nPROC m()\nMoveL p1,v5,fine,tMissing;\nENDPROC", "tMissing"),
    ("CONST jointtarget j1:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", "joints alone"),
])  # fmt: skip

_POS = "X = 1 mm, Y = 2 mm, Z = 3 mm,\nW = 10 deg, P = 20 deg, R = 30 deg"


def _ls(numbers: str = _POS, head: str = "UF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',") -> str:
    return f"P[1]{{\n GP1:\n {head}\n{numbers}\n}};"


FANUC = Dialect("a.ls", lambda body: f"/PROG A\n/MN\n/POS\n{body}\n/END\n", [
    (_ls(), {"P[1]": P}),
    (_ls().replace("P[1]", 'P[1:"name; with"]'), {"P[1]": P}),
    (_ls().replace("P[1]", 'P[1:""]'), {"P[1]": P}),
    (_ls().replace(" = ", "="), {"P[1]": P}),
    (_ls().replace(" ", "\t"), {"P[1]": P}),
    (_ls(_POS.replace("X = 1 ", "X =     1.000  ")), {"P[1]": P}),
    (_ls(_POS.replace("W = 10", "W = 1.0E+01")), {"P[1]": P}),
    (_ls(_POS.replace(",\n", ",")), {"P[1]": P}),
    (_ls(head="UF : 0, UT : 0, CONFIG : '',"), {"P[1]": P}),
    (_ls(head="UF : 0, UT : 0, CONFIG : 'F U T, 0, 0, 0',"), {"P[1]": P}),
    (_ls(head="UF : 0, UT : 0, KONFIG : 'N U T, 0, 0, 0',"), {"P[1]": P}),
    (_ls(_POS + ",\nE1= 20.000 mm"), {"P[1]": P}),
    (_ls().replace("\n}", "\n GP2:\n UF : 0, UT : 0,\nJ1= 100.000 mm\n}"), {"P[1]": P}),
    (_ls(_POS.replace("1 mm", ".5 mm")), {"P[1]": (0.5, *P[1:])}),
    (_ls(_POS.replace("1 mm", "-.5 mm")), {"P[1]": (-0.5, *P[1:])}),
    (_ls(_POS.replace("1 mm", "******** mm")), r"P\[1\]"),
    (_ls(_POS.replace("1 mm", "1 in")), r"P\[1\]"),
    (_ls(_POS.replace("10 deg", "10 rad")), r"P\[1\]"),
    (_ls(_POS.replace("Z = 3 mm,", "")), r"P\[1\]"),
    (_ls(head="UF : 4, UT : 0, CONFIG : 'N U T, 0, 0, 0',"), "frame 4"),
    (_ls(head="UF : 0, UT : 7, CONFIG : 'N U T, 0, 0, 0',"), "tool 7"),
    (_ls("J1= 0 deg, J2= 0 deg, J3= 0 deg,\nJ4= 0 deg, J5= 0 deg, J6= 0 deg"), "joints alone"),
    (_ls() + "\n" + _ls(_POS.replace("1 mm", "9 mm")), "other numbers"),
])  # fmt: skip

_U = (0.1, 0.2, 0.3, 0.0, 1.5, 0.0)
_N = "0.1,0.2,0.3,0,1.5,0"
UR = Dialect("a.script", lambda body: f"def a():\n{body}\nend\n", [
    (f"  q=p[{_N}]", {"q": _U}),
    (f"  global Waypoint_1_p=p[{_N}]", {"Waypoint_1_p": _U}),
    (f"  local q = p[ {_N.replace(',', ' , ')} ]", {"q": _U}),
    ("  q=p[.1, .2, .3, 0, 1.5, 0]", {"q": _U}),
    ("  q=p[1e-1, 2.0E-1, +.3, -0.0, 1.5, 0.]", {"q": _U}),
    (f"  movel(p[{_N}], a=1.2, v=0.25)", {"line 2": _U}),
    (f"  movej(p[{_N}])", {"line 2": _U}),
    (f"  movep(p[{_N}],r=0.01)", {"line 2": _U}),
    (f"  servoc(p[{_N}])", {"line 2": _U}),
    (f"  movej(get_inverse_kin(p[{_N}]))", {"line 2": _U}),
    (f"  movel(p[{_N}]) # p[9,9,9,0,0,0]", {"line 2": _U}),
    (f"  # movel(p[9,9,9,0,0,0])\n  q=p[{_N}]", {"q": _U}),
    (f'  textmsg("p is ")\n  q=p[{_N}]', {"q": _U}),
    (f"  $ 4 \"Waypoint_1\" \"breakAfter\"\n  q=p[{_N}]", {"q": _U}),
    (f"  q=p[{_N}]\n  q=p[{_N}]", {"q": _U}),
    ("  q=p[0.1,0.2,0.3,0,d2r(90),0]", {"q": (0.1, 0.2, 0.3, 0.0, 1.5707963267948966, 0.0)}),
    (f"  q=p[{_N}]\n  q=p[0.9,0.2,0.3,0,1.5,0]", "other numbers"),
    ("  q=p[0.1,0.2,0.3,0,1.5]", "5 numbers"),
    ("  q=p[0.1,0.2,0.3,0,1.5,0", "brackets do not match"),
    ("  q=p[0.1,0.2,x+0.3,0,1.5,0]", "no number"),
    ("  q=p[100,200,300,0,1.5,0]", "millimetres"),
    ("  q=p[0.1,0.2,0.3,0,90,0]", "degrees"),
    (f"  q=pose_trans(Plane_1, p[{_N}])", "calculation"),
    (f"  x=pose_add(p[{_N}],p[{_N}])", "calculation"),
])  # fmt: skip

_R = "1.000,2.000,3.000,10.0000,20.0000,30.0000"


def _jbi(points: str, head: str = "///TOOL 0\n///POSTYPE BASE\n///RECTAN\n///RCONF 1,0,0,0,0,0,0,0\n") -> str:
    return f"{head}{points}"


YASKAWA = Dialect("A.JBI", lambda body: f"/JOB\n//NAME A\n//POS\n///NPOS 1,0,0\n{body}\n//INST\nNOP\nEND\n", [
    (_jbi(f"C00000={_R}"), {"C00000": P}),
    (_jbi(f"P00100={_R}"), {"P00100": P}),
    (_jbi(f"C00000={_R.replace(',', ', ')}  "), {"C00000": P}),
    (_jbi(f"C00000 = {_R}"), {"C00000": P}),
    (_jbi("C00000=1,2,3,10,20,30"), {"C00000": P}),
    (_jbi("C00000=0001.0000000,2.,3,10.0,20,30"), {"C00000": P}),
    (_jbi(f"C00000={_R}", "///TOOL 0\n///POSTYPE BASE\n///RECTAN\n"), {"C00000": P}),
    (_jbi(f"C00000={_R}", "///TOOL 0\n///POSTYPE ROBOT\n///RECTAN\n"), {"C00000": P}),
    (_jbi(f"C00000={_R}\n///RCONF 0,0,0\nC00001={_R}"), {"C00000": P, "C00001": P}),
    (_jbi(f"C00000={_R}\nC00000={_R}"), {"C00000": P}),
    (_jbi(f"BC00000=0.000\nC00000={_R}"), {"C00000": P}),
    (_jbi(f"C00000={_R}\n///POSTYPE PULSE\n///PULSE\nC00001=0,0,0,0,0,0"), {"C00000": P}),
    (_jbi("C00000=-1,-2,-3,-10,-20,-30"), {"C00000": (-1, -2, -3, -10, -20, -30)}),
    (_jbi(f"C00000={_R}\nC00000={_R.replace('1.000', '9.000', 1)}"), "other numbers"),
    (_jbi("C00000=1,2,3,10,20"), "C00000"),
    (_jbi("C00000=1,2,3,10,20,abc"), "C00000"),
    (_jbi("C00000=1 2 3 10 20 30"), "C00000"),
    (_jbi(f"C00000={_R}", "///TOOL 3\n///POSTYPE BASE\n///RECTAN\n"), "tool 3"),
    (_jbi(f"C00000={_R}", "///TOOL 0\n///USER 2\n///POSTYPE USER\n///RECTAN\n"), "frame 2"),
    (_jbi("C00000=0,0,0,0,0,0", "///TOOL 0\n///POSTYPE PULSE\n///PULSE\n"), "[Pp]ulse"),
    (_jbi("C00000=0,0,0,0,0,0", "///TOOL 0\n///POSTYPE ANGLE\n///ANGLE\n"), "C00000|ANGLE"),
    (_jbi(f"C00000={_R}", "///TOOL 0\n///POSTYPE MASTER\n///RECTAN\n"), "C00000|MASTER"),
])  # fmt: skip

_K = "1.0 2.0 3.0 10.0 20.0 30.0"
KAWASAKI = Dialect("a.as", lambda body: f".TRANS\n{body}\n.END\n", [
    (f"p1 {_K}", {"p1": P}),
    (f"  p1   {_K.replace(' ', '   ')}", {"p1": P}),
    (f"p1\t{_K.replace(' ', chr(9))}", {"p1": P}),
    ("p1 1 2 3 10 20 30", {"p1": P}),
    ("p1 1.000000 2.0 3. 1.0E1 2e1 +30", {"p1": P}),
    (f"p1[3] {_K}", {"p1[3]": P}),
    (f"p1[3,4] {_K}", {"p1[3,4]": P}),
    (f"start.point {_K}", {"start.point": P}),
    (f"P1 {_K}", {"P1": P}),
    (f"p1 {_K}\np2 {_K}", {"p1": P, "p2": P}),
    (f"p1 {_K}\n\np2 {_K}", {"p1": P, "p2": P}),
    (f"p1 {_K}\np1 {_K}", {"p1": P}),
    (f"p1 {_K} ; taught", {"p1": P}),
    (f"; p0 {_K}\np1 {_K}", {"p1": P}),
    ("p1 -1 -2 -3 -10 -20 -30", {"p1": (-1, -2, -3, -10, -20, -30)}),
    (f"p1 {_K}\np1 {_K.replace('1.0', '9.0', 1)}", "other numbers"),
    ("p1 1 2 3 10 20", "p1"),
    ("p1 1 2 3 10 20 abc", "p1"),
    ("p1 1,2 2 3 10 20 30", "p1"),
    ("p1 1 2 3 10 20 3O", "p1"),
])  # fmt: skip


def _point(attributes: str = 'x="1" y="2" z="3" rx="10" ry="20" rz="30"', father: str = "world[0]") -> str:
    value = f'<Value key="0" {attributes} fatherId="{father}" />'
    return f'<Data name="p" access="private" xsi:type="array" type="pointRx" size="1">\n{value}\n</Data>'


_NS = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xmlns="http://www.staubli.com/robotics/VAL3/Data/2"'
STAUBLI = Dialect("a.dtx", lambda body: f"<Database {_NS}>\n<Datas>\n{body}\n</Datas>\n</Database>\n", [
    (_point(), {"p[0]": P}),
    (_point().replace('" y=', '"\n   y='), {"p[0]": P}),
    (_point().replace('"1"', "'1'"), {"p[0]": P}),
    (_point().replace('"1"', '"1.000"'), {"p[0]": P}),
    (_point().replace('"1"', '"+1.0e0"'), {"p[0]": P}),
    (_point('rz="30" ry="20" rx="10" z="3" y="2" x="1"'), {"p[0]": P}),
    (_point().replace('access="private"', 'access="public"'), {"p[0]": P}),
    (_point().replace(' />', ' shoulder="lefty" elbow="epositive" wrist="wpositive" />'), {"p[0]": P}),
    (_point().replace(' />', '></Value>'), {"p[0]": P}),
    ("<!-- taught -->" + _point(), {"p[0]": P}),
    (_point() + _point().replace('"p"', '"q"'), {"p[0]": P, "q[0]": P}),
    (_point() + _point(), {"p[0]": P}),
    (_point().replace('key="0"', 'key="7"'), {"p[7]": P}),
    (_point('x="-1" y="2" z="3" rx="10" ry="20" rz="30"'), {"p[0]": (-1, *P[1:])}),
    (_point() + '<Data name="n" access="private" xsi:type="array" type="num" size="1">'
     '<Value key="0" value="5" /></Data>', {"p[0]": P}),
    (_point() + _point('x="9" y="2" z="3" rx="10" ry="20" rz="30"'), "other numbers"),
    (_point('x="abc" y="2" z="3" rx="10" ry="20" rz="30"'), r"p\[0\]"),
    (_point('x="1,5" y="2" z="3" rx="10" ry="20" rz="30"'), r"p\[0\]"),
    (_point('x="nan" y="2" z="3" rx="10" ry="20" rz="30"'), r"p\[0\]"),
    (_point(father="fUnknown[0]"), "fUnknown"),
])  # fmt: skip


def _numbers_by_hand(write: Callable[[str], str], name: str, ending: str = "") -> list[tuple[str, Expected]]:
    """Return the ways in which a statement's numbers are written, and those that are none."""
    return [
        (write("1,2,3,10,20,30"), {name: P}),
        (write("1.000, 2.000, 3.000, 10.000, 20.000, 30.000"), {name: P}),
        (write(" 1 , 2 , 3 , 10 , 20 , 30 "), {name: P}),
        (write("+1,2.,3.0,1.0E1,2e+1,30"), {name: P}),
        (write("-1,-2,-3,-10,-20,-30"), {name: (-1, -2, -3, -10, -20, -30)}),
        (write(".5,-.25,3,10,20,30"), {name: (0.5, -0.25, *P[2:])}),
        ("   " + write("1,2,3,10,20,30") + "   ", {name: P}),
        ("\t" + write("1,2,3,10,20,30"), {name: P}),
        (write("1,2,3,10,20,30").upper(), {name.upper(): P}),
        (write("1,2,3,10,20,30") + "\n\n" + write("1,2,3,10,20,30"), {name: P}),
        (write("1,2,3,10,20,30") + f"  {ending} taught", {name: P}),
        (f"{ending} " + write("9,9,9,0,0,0") + "\n" + write("1,2,3,10,20,30"), {name: P}),
        (write("1,2,3,10,20,30") + "\n" + write("9,2,3,10,20,30"), "other numbers"),
        (write("1,2,3,10,20"), "5 numbers"),
        (write("1,2,3,10,20,"), "numbers|number"),
        (write("1,,3,10,20,30"), "no number"),
        (write("1,2,3,10,20,3O"), "cannot be read"),
        (write("1,2,x+3,10,20,30"), "cannot be read"),
        (write("1.2.3,2,3,10,20,30"), "no number"),
        (write("1,2,3,10,20,30")[:-4], "cannot be read"),
    ]


MITSUBISHI = Dialect("a.prg", lambda body: f"1 Ovrd 100\n{body}\nEnd\n", [
    *_numbers_by_hand(lambda n: f"P1=({n})(7,0)", "P1", "'"),
    ("P1=(1,2,3,10,20,30)", {"P1": P}),
    ("Psafe=(1,2,3,10,20,30)(6,0)", {"Psafe": P}),
    ("P_X(3)=(1,2,3,10,20,30)(6,0)", {"P_X(3)": P}),
    ("20 P1=(1,2,3,10,20,30)(7,0)", {"P1": P}),
    ("P1=(1,2,3,10,20,30,45,0)(7,0)", {"P1": P}),
    ("Base (100,0,0,0,0,0)\nP1=(1,2,3,10,20,30)(7,0)", "which way round that works is not settled"),
    ("Base (0.00,0,0,0,0,0)(0,0)\nP1=(1,2,3,10,20,30)(7,0)", {"P1": P}),
    ("P1=P2*P3", "cannot be read"),
    ("P1=1,2,3,10,20,307,0)", "cannot be read"),
    ("P1=(1,2,3,10,20,307,0)", "cannot be read"),
    ("30 Mov P9", "P9: a move goes there"),
    ("J1=(0,0,90,0,90,0)", "joints alone"),
])  # fmt: skip
DENSO = Dialect("a.pcs", lambda body: f"Sub Main\nTakeArm Keep = 0\n{body}\nEnd Sub\n", [
    *_numbers_by_hand(lambda n: f"P[1] = P({n})", "P[1]", "'"),
    ("P[12]=P(1,2,3,10,20,30,-1)", {"P[12]": P}),
    ("P[1] = (1,2,3,10,20,30)", {"P[1]": P}),
    ("Move P, P(1,2,3,10,20,30), Speed = 20", {"line 3": P}),
    ("Move L, @0 P(1,2,3,10,20,30)", {"line 3": P}),
    ("Tool 1, P(0,0,0,0,0,0)\nChangeTool 1\nP[1] = P(1,2,3,10,20,30)", {"P[1]": P}),
    ("ChangeTool 4\nP[1] = P(1,2,3,10,20,30)", "tool 4"),
    ("ChangeWork 2\nP[1] = P(1,2,3,10,20,30)", "frame 2"),
    ("Move L, P[9]", r"P\[9\]: a move goes there"),
    ("P[1] = CurPos", "cannot be read"),
])  # fmt: skip
EPSON = Dialect("a.prg", lambda body: f"Function main\nMotor On\n{body}\nFend\n", [
    *_numbers_by_hand(lambda n: f"P1 = XY({n})", "P1", "'"),
    ("P1 = XY(1,2,3,10,20,30) /R /A /NF", {"P1": P}),
    ("P1 = XY(1,2,3,10,20,30) /L", {"P1": P}),
    ("P(3) = XY(1,2,3,10,20,30)", {"P(3)": P}),
    ("Go XY(1,2,3,10,20,30)", {"line 3": P}),
    ("TLSet 1, XY(0,0,0,0,0,0)\nTool 1\nP1 = XY(1,2,3,10,20,30)", {"P1": P}),
    ("Tool 3\nP1 = XY(1,2,3,10,20,30)", "tool 3"),
    ("P1 = XY(1,2,3,10,20,30) /2", "frame 2"),
    ("Go P9", "P9: a move goes there"),
    ("P1 = Here +Z(10)", "cannot be read"),
])  # fmt: skip
COMAU = Dialect("a.pdl", lambda body: f"PROGRAM a NOHOLD\nBEGIN\n{body}\nEND a\n", [
    *_numbers_by_hand(lambda n: f"p1 := POS({n}, '')", "p1", "--"),
    ("p1 := POS(1,2,3,10,20,30, 'S W')", {"p1": P}),
    ("p1 := POS(1,2,3,10,20,30)", {"p1": P}),
    ("pnt[4] := POS(1,2,3,10,20,30,'')", {"pnt[4]": P}),
    ("MOVE LINEAR TO POS(1,2,3,10,20,30,'')", {"line 3": P}),
    ("$TOOL := POS(0,0,0,0,0,0,'')\np1 := POS(1,2,3,10,20,30,'')", {"p1": P}),
    ("MOVE JOINT TO {0,0,-90,0,90,0}", "joints alone"),
    ("MOVE LINEAR TO pnt9", "pnt9: a move goes there"),
    ("p1 := POS(x, 2, 3, 10, 20, 30, '')", "cannot be read"),
])  # fmt: skip
DOOSAN = Dialect("a.drl", lambda body: f"set_velj(60.0)\n{body}\nwait(1)\n", [
    *_numbers_by_hand(lambda n: f"p1 = posx({n})", "p1", "#"),
    ("Global_p = posx(1,2,3,10,20,30)", {"Global_p": P}),
    ("movel(posx(1,2,3,10,20,30), v=250)", {"line 2": P}),
    ("j1 = posj(0,0,90,0,90,0)", "joints alone"),
    ("movel(elsewhere, v=250, a=1000)", "elsewhere: a move goes there"),
    ("p1 = posx(trans(p2, d))", "cannot be read"),
])  # fmt: skip


def _movex(numbers: str, more: str = "S=100.0,H=0,MS,CONF=0000") -> str:
    return f"MOVEX A=1P,AC=0,SM=0,M1X,L,({numbers}),{more}"


NACHI = Dialect("a.src", lambda body: f"REM a\n{body}\nEND\n", [
    *[(piece, {"line 2": next(iter(expected.values()))} if isinstance(expected, dict) else expected)
      for piece, expected in _numbers_by_hand(_movex, "", "'") if "\n" not in piece and "CONF=0" in piece.upper()],
    (_movex("1,2,3,10,20,30").replace(",L,", ",P,"), {"line 2": P}),
    (_movex("1,2,3,10,20,30").replace(",L,", ", C1 ,").replace("C1", "C"), {"line 2": P}),
    (_movex("1,2,3,10,20,30", "S=100.0,H=2,MS"), "tool 2"),
    ("MOVEX A=1,M1J,P,(0,0,90,0,90,0),T=0.2,H=0,MS", "joints alone"),
    ("' " + _movex("9,9,9,0,0,0") + "\n" + _movex("1,2,3,10,20,30"), {"line 3": P}),
    (_movex("1,2,3,10,20,30") + "\n" + _movex("4,2,3,10,20,30"), {"line 2": P, "line 3": (4.0, *P[1:])}),
])  # fmt: skip

ODDITIES = {
    "kuka": KUKA, "abb": ABB, "fanuc": FANUC, "ur": UR, "yaskawa": YASKAWA, "kawasaki": KAWASAKI,
    "staubli": STAUBLI, "mitsubishi": MITSUBISHI, "denso": DENSO, "epson": EPSON, "comau": COMAU, "doosan": DOOSAN,
    "nachi": NACHI,
}  # fmt: skip
