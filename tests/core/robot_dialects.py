"""Files in the dialects of robot controllers, written by hand with their oddities; none is copied."""

RAPID = """MODULE Cell
  PERS tooldata tGrip:=[TRUE,[[0,0,184],[1,0,0,0]],[0.5,[0,0,92],[1,0,0,0],1,2,3]];
  TASK PERS tooldata tStand:=[FALSE,[[800,0,184],[1,0,0,0]],[0.5,[0,0,92],[1,0,0,0],1,2,3]];
  TASK PERS wobjdata wTable:=[FALSE,TRUE,"",[[100,0,0],[1,0,0,0]],[[0,0,5],[0.707106781,0,0,0.707106781]]];
  PERS wobjdata wTurn:=[FALSE,FALSE,"STN1",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget pA:=[[551,613,25],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]; ! with "quotes" ; and p
  CONST robtarget pArray{2}:=[[[1,2,3],[1,0,0,0],[0,0,0,0],[45,9E9,9E9,9E9,9E9,9E9]],
    [[4,5,6],[1,0,0,0],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]];
  VAR robtarget pEmpty;
  CONST jointtarget jHome:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL pA,v100,fine,tGrip\\WObj:=wTable;
    MoveJ \\Conc,pArray{1},v100,z10,tool0;
    MoveC pArray{2},Offs(pA,0,0,1),v100,fine,tool0\\WObj:=wobj0;
    MoveL [[7,8,9],[1,0,0,0],[0,0,0,0],extj],v100,fine,tool0;
    MoveL pA,v100,fine,tUnknown;
    MoveL [[1,1,1],[1,0,0,0],[0,0,0,0],extj],v100,fine,tStand;
    MoveL [[1,1,1],[1,0,0,0],[0,0,0,0],extj],v100,fine,tool0\\WObj:=wTurn;
  ENDPROC
ENDMODULE
"""
CONFIG = """&ACCESS RV
DEFDAT  $CONFIG PUBLIC
TOOL_DATA[1]={X 107.147003,Y 6.19999992E-05,Z 313.237,A 0.0,B 45.0,C 0.0}
TOOL_DATA[2]={X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
TOOL_NAME[1,]="GUN"
TOOL_TYPE[1]=#BASE
TOOL_TYPE[2]=#TCP
BASE_DATA[1]={X 0.0,Y 0.0,Z 100.0,A 90.0,B 0.0,C 0.0}
LOAD_DATA[1]={M 5.5,CM {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0},J {X 0.1,Y 0.2,Z 0.3}}
ENDDAT
"""
DAT = """DEFDAT style1
DECL PDAT PPDAT1={VEL 100.000,ACC 100.000,APO_DIST 100.000}
DECL E6POS XP1={X 214.5,Y 193.6,Z 1005.8,A 6.6,B -23.4,C 9.8,S 2,T 3,E1 45.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL FDAT FP1={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}
DECL GLOBAL POS XP2 = { X 1.0, Y 2.0, Z 3.0, A 0.0, B 0.0, C 0.0, S 0, T 0}
DECL FDAT FP2 = {BASE_NO 1, TOOL_NO 1, IPO_FRAME #BASE, POINT2[] " "}
DECL E6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0}
DECL E6POS XP3={X 1,Y 2,Z 3
DECL E6POS XP4={X 1,Y 2,Z 3,A 0,B 0,C 0}
DECL FDAT FP4={TOOL_NO 2,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}
DECL E6POS XP5={X 1,Y 2,Z 3,A 0,B 0,C 0}
DECL FDAT FP5={TOOL_NO 1,BASE_NO 1,IPO_FRAME #TCP,POINT2[] " "}
ENDDAT
"""
SRC = """DEF moves()
$TOOL = {X 94.0, Y -1.5, Z 213.0, A 0, B 0, C 0 }
$BASE=$NULLFRAME
PTP {X 100,Y 0,Z 500,A 0,B 0,C 0,S 2,T 2} C_PTP
LIN {X 100}
LIN_REL {Z 20} #TOOL
LIN {X 1,Y 0,Z 500,A 0,B 0,C 0} : XOFF
PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}
$BASE=BASE_DATA[7]
LIN {X 100,Y 0,Z 500,A 0,B 90,C 0}
END
"""
LS = """/PROG  TEST1
/MN
   1:J P[1] 100% FINE    ;
   2:L P[2:"a b"] 100mm/sec FINE INC ;
/POS
P[1]{
   GP1:
\tUF : 0, UT : 1,\t\tKONFIG : 'N U T, 0, 0, 0',
\tX =  -464.787  mm,\tY =  -676.745  mm,\tZ =  .140  mm,
\tW =   142.550 deg,\tP =    72.302 deg,\tR =  -130.575 deg
   GP2:
\tUF : 0, UT : 1,\t
\tJ1=   100.000  deg
};
P[2:"a b"]{
   GP1:
\tUF : 0, UT : 0,\t\tCONFIG : 'L, 0, 0, 0',
\tX =   -22.034184  mm,\tY =  -500.1  mm,\tZ =   227.5  mm,
\tW =  -180.000000 deg,\tP =     0.000000 deg,\tR =  -148.7 deg
};
P[3]{
   GP1:
\tUF : F, UT : F,\t\tCONFIG : '',
\tX =   1  mm,\tY =  2  mm,\tZ =   3  mm,
\tW =  -180.000000 deg,\tP =     0.000000 deg,\tR =  -148.7 deg,
\tE1=   20.000  mm
};
P[4]{
   GP1:
\tUF : 0, UT : 1,\t
\tJ1=     0.000 deg,\tJ2=   -30.000 deg,\tJ3=     -.000 deg,
\tJ4=      .500 deg,\tJ5=   -90.000 deg,\tJ6=   180.000 deg
};
P[5]{
   GP1:
\tUF : 3, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',
\tX = ********  mm,\tY =  2  mm,\tZ =   3  mm,
\tW =  0 deg,\tP = 0 deg,\tR =  0 deg
};
/END
"""
VA = """[*SYSTEM*]$MNUTOOL  Storage: CMOS  Access: RW  : ARRAY[2,20] OF POSITION
  [1,1] = 'Grip' Group: 1   Config: N D B, 0, 0, 0
    X:   0.000   Y:   .140   Z: 150.000
    W:   0.000   P:   0.000   R:   0.000
  [1,2] = Uninitialized
  [2,1] = '' Group: 2   Config:
    X:   0.000   Y: 200.000   Z: 300.000
    W:   0.000   P:   0.000   R:   0.000
[*SYSTEM*]$MNUTOOLNUM  Storage: CMOS  Access: RW  : ARRAY[2] OF BYTE
  [1] = 1
"""
SCRIPT = """def prog():
  set_tcp(p[0,0,0.1,0,0,0])
  global Waypoint_1_p=p[.42, -.25, .3, 0, 3.14159, 0]
  global Waypoint_1_q=[-1.6007, -1.7271, -2.2030, -0.8080, 1.5951, -0.0310]
  movel(Waypoint_1_p, a=1.2, v=0.25) # p[1,2,3,4,5,6]
  movel(p[400, 1,1,0,0,0])
  movej(p[0.4, 0.1,0.1,d2r(90),0,0])
  x = pose_trans(Plane_1, p[0,0,0.1,0,0,0])
  movel(p[0.4, 0.1,0.1,180,0,0])
end
"""
JBI = """/JOB
//NAME TEST
//POS
///NPOS 3,0,1,0,0,0
///TOOL 1
///POSTYPE BASE
///RECTAN
///RCONF 0,0,0
C00000=100.000,200.000,300.000,180.0000,0.0000,90.0000
///USER 2
///POSTYPE USER
C00001=1.000,2.000,3.000,0.0000,0.0000,0.0000
///TOOL 0
///POSTYPE ROBOT
C00002=1.000,2.000,3.000,0.0000,0.0000,0.0000
///POSTYPE PULSE
///PULSE
C00003=0,0,0,0,0,0
EC00000=1000
//INST
NOP
"""
TOOL_CND = """//TOOL 0
///NAME
0.000,0.000,0.000,0.0000,90.0000,0.0000
0.000,0.000,0.000
0.000
//TOOL 1
///NAME GRIP
0.000,0.000,100.000,0.0000,0.0000,0.0000
0.000,0.000,0.000
"""
UFRAME_CND = """//UFRAME 2
///NAME TABLE
///TOOL 0
///PULSE
////RORG C000=0,0,0,0,0,0
////BUSER 10.000,0.000,0.000,0.0000,0.0000,90.0000
"""
AS = """.PROGRAM main()
  TOOL t1
  BASE NULL
  LMOVE p1
  JMOVE p[2]
  LMOVE p1+d
  POINT q = TRANS(1,2,3,4,5,6)
.END
.TRANS
p1 100.0 200.0 300.0 0.0 0.0 10.0
p[2] 100.0 200.0 300.0 90.0 45.0 10.0 30.0
t1 0.0 0.0 150.0 0.0 0.0 0.0
.END
.JOINTS
#home 0 0 0 0 0 0
"""
DTX = """<?xml version="1.0" encoding="utf-8"?>
<Database xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xmlns="http://www.staubli.com/robotics/VAL3/Data/2">
  <Datas>
    <Data name="fTable" access="private" xsi:type="array" type="frame" size="1">
      <Value key="0" x="600" z="-465" fatherId="world[0]" /></Data>
    <Data name="tTool" access="private" xsi:type="array" type="tool" size="1">
      <Value key="0" x="-5.972" y="209.431" z="55.323" rz="90" fatherId="flange[0]" ioLink="valve1" />
    </Data>
    <Data name="pA" access="private" xsi:type="array" type="pointRx" size="1">
      <Value key="0" x="1" y="2" z="3" fatherId="fTable[0]" />
      <Value key="1" x="1" y="2" z="3" fatherId="fLost[0]" />
    </Data>
    <Data name="jA" access="private" xsi:type="array" type="jointRx" size="1"><Value key="0" j2="10"/></Data>
  </Datas>
</Database>
"""
DTX_6 = """<?xml version="1.0" encoding="utf-8" ?>
<dataList xmlns="DataNameSpace">
  <boolSection />
  <frameSection>
    <frame name="world" public="false"><fFather alias="" name="" fatherIndex="0" />
      <valueFrame index="0"><tfValue x="0" y="0" z="0" rx="0" ry="0" rz="0" /></valueFrame></frame>
    <frame name="fTable" public="false"><fFather alias="" name="world" fatherIndex="0" />
      <valueFrame index="0"><tfValue x="0" y="0" z="0" rx="0" ry="0" rz="0" /></valueFrame>
      <valueFrame index="1"><tfValue x="600" y="0" z="-465" rx="0" ry="0" rz="0" /></valueFrame></frame>
  </frameSection>
  <jointSection>
    <joint name="jA" public="false"><valueJoint index="0">
      <jointValue j1="0" j2="10" j3="0" j4="0" j5="0" j6="0" /></valueJoint></joint>
  </jointSection>
  <pointSection>
    <point name="pA" public="false"><pFather alias="" name="fTable" fatherIndex="1" />
      <valuePoint index="0"><tpValue x="1" y="2" z="3" rx="0" ry="0" rz="0" />
        <cpValue shoulder="ssame" elbow="esame" wrist="wsame" /></valuePoint></point>
    <point name="pB" public="false"><pFather alias="" name="fLost" fatherIndex="0" />
      <valuePoint index="0"><tpValue x="1" y="2" z="3" rx="0" ry="0" rz="0" /></valuePoint></point>
  </pointSection>
  <toolSection>
    <tool name="flange" public="false"><tFather alias="" name="" fatherIndex="0" />
      <valueTool index="0"><ttValue x="0" y="0" z="0" rx="0" ry="0" rz="0" /></valueTool></tool>
    <tool name="tTool" public="false"><tFather alias="" name="flange" fatherIndex="0" />
      <valueTool index="0"><ttValue x="-5.972" y="209.431" z="55.323" rx="0" ry="0" rz="90" />
        <io alias="io" name="valve1" ioIndex="0" open="0" close="0" /></valueTool></tool>
  </toolSection>
</dataList>
"""
