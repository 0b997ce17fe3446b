"""The register of equipment: sessions refer to its pieces, and keep what it said."""

import httpx

from tests.server.live_server import assert_problem

DCC = b"""<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" schemaVersion="3.2.1">
 <dcc:administrativeData><dcc:coreData><dcc:uniqueIdentifier>K-123</dcc:uniqueIdentifier>
 <dcc:endPerformanceDate>2026-02-27</dcc:endPerformanceDate></dcc:coreData>
 <dcc:items><dcc:item><dcc:name><dcc:content>Sphere 80 mm</dcc:content></dcc:name><dcc:model>Ceramic</dcc:model>
 <dcc:identifications><dcc:identification><dcc:issuer>customer</dcc:issuer><dcc:value>ours</dcc:value></dcc:identification>
 <dcc:identification><dcc:issuer>manufacturer</dcc:issuer><dcc:value>S-4711</dcc:value></dcc:identification>
 </dcc:identifications></dcc:item></dcc:items>
 <dcc:calibrationLaboratory><dcc:contact><dcc:name><dcc:content>Example Laboratory</dcc:content></dcc:name>
 </dcc:contact>
 </dcc:calibrationLaboratory></dcc:administrativeData></dcc:digitalCalibrationCertificate>"""
UR = {"pose_convention": "ur"}


def test_a_certificate_is_read_whole_and_sessions_keep_what_the_register_said(
    client: httpx.Client,
) -> None:
    made = client.post("/equipment", json={"kind": "sphere", "certificate": {"due": "2020-01-01"}})
    assert (made.status_code, made.json()["overdue"]) == (201, True)
    here = f"/equipment/{made.json()['id']}"
    assert_problem(client.get(f"{here}/certificate"), 404, "Upload")
    read = client.put(f"{here}/certificate", files={"file": ("K-123.xml", DCC)}).raise_for_status().json()
    assert (read["name"], read["model"], read["serial"]) == ("Sphere 80 mm", "Ceramic", "S-4711")
    certificate = {"number": "K-123", "laboratory": "Example Laboratory", "issued": "2026-02-27"}
    assert read["certificate"] == {**certificate, "due": "2020-01-01", "file": "K-123.xml"}
    assert client.get(f"{here}/certificate").content == DCC
    cell = {**UR, "equipment": [{"kind": "sphere", "register_id": made.json()["id"]}]}
    session = client.post("/sessions", json={"name": "referring", "cell": cell}).raise_for_status().json()
    (piece,) = session["cell"]["equipment"]
    assert (piece["serial"], piece["certificate"]["number"]) == ("S-4711", "K-123")
    client.put(here, json={"kind": "sphere", "serial": "S-4712"}).raise_for_status()
    stored = client.get(f"/sessions/{session['id']}").json()["cell"]["equipment"]
    assert stored == [piece]  # what was used does not change afterwards
    again = client.patch(f"/sessions/{session['id']}", json={"cell": cell}).raise_for_status().json()
    assert again["cell"]["equipment"][0]["serial"] == "S-4712"
    change = next(one for one in client.get("/audit").json()["items"] if one["path"].endswith(here))["change"]
    assert (change["before"]["serial"], change["after"]["serial"]) == ("S-4711", "S-4712")
    client.delete(here).raise_for_status()
    assert_problem(client.post("/sessions", json={"cell": cell}), 404, "equipment")
    assert_problem(client.put(f"{here}/certificate", files={"file": ("a.pdf", b"%PDF")}), 404, "listed")
