"""The operations of the workbench's API, made by `scancell schema python-client`, not to be edited."""

import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from .connection import Connection


class Operations(Connection):
    """Each operation as a method that returns the answer's data: JSON, or bytes where it is a file."""

    def answers_get_answer(self, session_id: str) -> Any:
        """Return the session's answer, of `chain` or else `tcp`: frames, covariance, verdict, hashes, and
        `stale`. It is given as it is; `faults` says what speaks against acting on it."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/answer")

    def answers_get_frames(self, session_id: str, *, into: str | None = None, outof: str | None = None, capture: str | None = None) -> Any:
        """Return the cell's transforms: measured, known, solved or sought; and `into_from_outof`, where
        asked for."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/frames", params=_given({"into": into, "outof": outof, "capture": capture}))

    def answers_export_results(self, session_id: str, name: str, *, allow: str | None = None, settings: str | None = None) -> Any:
        """Return the calibrated tool and table in a format's syntax; with faults of its own it is
        refused."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/exports/{quote(name, safe='/')}", params=_given({"allow": allow, "settings": settings}))

    def machines_export_into_backup(self, session_id: str, name: str, backup: Mapping[str, bytes], settings: Any, allow: Any) -> Any:
        """Return the file of a backup that defines the tool, with that one entry changed and every other
        byte kept. Of several files it is the one that holds the entry; a zip comes back with that one file
        in it changed."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/exports/{quote(name, safe='/')}", files=[*_files("backup", backup), *_text("settings", settings), *_text("allow", allow)])

    def archives_list_kept(self, session_id: str) -> Any:
        """List what the archive held that this session was imported from: its scene, report, truth,
        notes."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/kept")

    def archives_get_kept(self, session_id: str, name: str, *, show: bool | None = None) -> Any:
        """Return a file of the archive byte for byte, to be saved; with `show` the report as a page to look
        at."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/kept/{quote(name, safe='/')}", params=_given({"show": show}))

    def archives_get_archive(self, session_id: str, *, scene: bool | None = None) -> Any:
        """Return the session as one zip that still computes years later: record, files, results, past,
        pages."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/archive", params=_given({"scene": scene}))

    def archives_import_archive(self, content: Any) -> Any:
        """Make a session from an archive, with its captures and results; what is wrong with it leaves
        nothing behind. Its results are solved anew at once, by a job (`replay`), to see whether they are
        what its captures give; until then those that nobody who is trusted here has signed are `imported`,
        and no answer to export or release. What else it holds (scene, report, truth, notes) is kept as it
        came: GET …/kept."""
        return self.request("POST", "/api/v1/archives", content=content, headers={"Content-Type": "application/zip"})

    def archives_verify_archive(self, content: Any) -> Any:
        """Check that an archive is whole and a session, who signed it, and that its files agree; stores
        nothing."""
        return self.request("POST", "/api/v1/archives/verify", content=content, headers={"Content-Type": "application/zip"})

    def archives_get_report(self, session_id: str, *, format_: str | None = None, paper: str | None = None) -> Any:
        """Return the session's report: one page that needs nothing else and can be printed, or as PDF. The
        server's own Chromium, Chrome or Edge prints the PDF; without one the answer is 422 and says so."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/report", params=_given({"format": format_, "paper": paper}))

    def captures_add_batch(self, session_id: str, content: Any) -> Any:
        """Store many captures, each a line of JSON with its record and `sizes`, followed by the bytes of
        its files. What is answered with 201 is on the disk, and 200 says that it was there already; both
        are measured soon after and told of as `capture` events. A capture that cannot be stored does not
        keep the others from it."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/captures/batch", content=content, headers={"Content-Type": "application/octet-stream"})

    def captures_add(self, session_id: str, record: Any, files: Mapping[str, bytes]) -> Any:
        """Store a capture and answer with what was measured in it. A capture in which nothing can be
        measured is kept, with the verdict `fail` and why; one whose record or files cannot be used at all
        is refused, and nothing of it is stored."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/captures", files=[*_text("record", record), *_files("files", files)])

    def captures_list_all(self, session_id: str, *, limit: int | None = None, cursor: str | None = None) -> Any:
        """List captures in the order of their arrival, with what was measured. Without `limit` and `cursor`
        it is all of them, else a page."""
        return self.whole("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/captures", params=_given({"limit": limit, "cursor": cursor}))

    def captures_take_simulated(self, session_id: str, *, step: str | None = None, again: str | None = None, why: str | None = None) -> Any:
        """Let the simulated cell take its next capture, one of `step` where that is named; or one of its
        own `again`. What is taken again has a name of its own (`p05-again`); arm and scanner err anew."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/sources/simulated/capture", params=_given({"step": step, "again": again, "why": why}))

    def captures_get(self, session_id: str, capture_id: str) -> Any:
        """Return a capture with what was measured in it."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/captures/{quote(capture_id, safe='')}")

    def captures_change(self, session_id: str, capture_id: str, body: Mapping[str, Any], *, if_match: str | None = None) -> Any:
        """Correct a capture's record; its files stay as they came."""
        return self.request("PATCH", f"/api/v1/sessions/{quote(session_id, safe='')}/captures/{quote(capture_id, safe='')}", json=body, headers={"If-Match": if_match})

    def captures_delete(self, session_id: str, capture_id: str, *, why: str | None = None, if_match: str | None = None) -> Any:
        """Remove a capture with its files, for good; to leave it out of solves, set `excluded` instead."""
        return self.request("DELETE", f"/api/v1/sessions/{quote(session_id, safe='')}/captures/{quote(capture_id, safe='')}", params=_given({"why": why}), headers={"If-Match": if_match})

    def captures_get_file(self, session_id: str, capture_id: str, name: str) -> Any:
        """Return a file as it came, byte for byte; `name` as in the record's `files`, or its last part."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/captures/{quote(capture_id, safe='')}/files/{quote(name, safe='/')}")

    def results_get_causes(self, session_id: str) -> Any:
        """Return why the session fails or is doubtful: by its fresh results or, where unsolved, by its
        captures."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/causes")

    def results_apply_cause(self, session_id: str, cause_id: str) -> Any:
        """Apply a root cause's remedy to the session; solve it again afterwards."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/causes/{quote(cause_id, safe='')}/apply")

    def results_change_together(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Change the cell and captures together, all or nothing; what undoes a remedy is sent here."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/changes", json=body)

    def cells_get_cells(self) -> Any:
        """List the cells: by `cell.id`, or an id made from the session's name where it has none."""
        return self.request("GET", "/api/v1/cells")

    def cells_get_history(self, cell_id: str) -> Any:
        """Return a cell's sessions and releases, and who acknowledged what, the newest first."""
        return self.request("GET", f"/api/v1/cells/{quote(cell_id, safe='')}/history")

    def cells_get_drift(self, cell_id: str) -> Any:
        """Return how tool, axis and verification moved over the cell's newest 100 sessions, and what
        changed."""
        return self.request("GET", f"/api/v1/cells/{quote(cell_id, safe='')}/drift")

    def cells_get_released(self, cell_id: str) -> Any:
        """Return the answer that was released last for a cell, as it was then, with what speaks against it
        now."""
        return self.request("GET", f"/api/v1/cells/{quote(cell_id, safe='')}/answer")

    def cells_get_policy(self, cell_id: str) -> Any:
        """Return what the cell asks for before an answer is released."""
        return self.request("GET", f"/api/v1/cells/{quote(cell_id, safe='')}/policy")

    def cells_put_policy(self, cell_id: str, body: Mapping[str, Any]) -> Any:
        """Set what the cell asks for before an answer is released; the audit log keeps what it was
        before."""
        return self.request("PUT", f"/api/v1/cells/{quote(cell_id, safe='')}/policy", json=body)

    def cells_acknowledge_fault(self, cell_id: str, body: Mapping[str, Any]) -> Any:
        """End `drift` or `equipment-changed` of a cell as it stands now, by name and with a reason."""
        return self.request("POST", f"/api/v1/cells/{quote(cell_id, safe='')}/acknowledge", json=body)

    def cells_release(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Put the session's answer in force for its cell; one with faults is refused unless they are
        allowed."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/release", json=body)

    def cells_rollback(self, cell_id: str, body: Mapping[str, Any]) -> Any:
        """Put an earlier release of a cell in force again; one with faults is refused unless they are
        allowed."""
        return self.request("POST", f"/api/v1/cells/{quote(cell_id, safe='')}/rollback", json=body)

    def clouds_list_clouds(self, session_id: str) -> Any:
        """Return the clouds and meshes that there are, with the formats that each is given in."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/clouds")

    def clouds_get_cloud(self, session_id: str, name: str, *, format_: str | None = None) -> Any:
        """Return the merged cloud or its mesh; as PLY it is what the merge stored, byte for byte."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/clouds/{quote(name, safe='/')}", params=_given({"format": format_}))

    def live_list_devices(self, session_id: str) -> Any:
        """List the devices of the session's cell with their states."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/devices")

    def live_put_device(self, session_id: str, device: str, body: Mapping[str, Any]) -> Any:
        """Keep a device with the cell and connect it for this session; `connected: false` ends its
        connection. Devices are read only: none of them moves anything."""
        return self.request("PUT", f"/api/v1/sessions/{quote(session_id, safe='')}/devices/{quote(device, safe='')}", json=body)

    def live_delete_device(self, session_id: str, device: str) -> Any:
        """Forget a device of the cell, its settings and its secrets."""
        return self.request("DELETE", f"/api/v1/sessions/{quote(session_id, safe='')}/devices/{quote(device, safe='')}")

    def live_put_live(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Say what live captures are taken for, and whether one is taken at each standstill at a new
        place."""
        return self.request("PUT", f"/api/v1/sessions/{quote(session_id, safe='')}/live", json=body)

    def live_take_shot(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Take a capture now: it is stored once robot, table and stripe prove that they stand still, else
        refused."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/live/capture", json=body)

    def live_take_sweep(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Record every exposure and the robot's poses for some seconds, and store them as one capture: a
        sweep. On the move the offset between the clocks must be known well enough for the speed; else it is
        refused. The files are removed from the recording's folder once they are stored."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/live/sweep", json=body)

    def live_measure_clocks(self, session_id: str) -> Any:
        """Measure the offset between the scanner's and the robot's clocks from what has just come. Before,
        the robot moves back and forth for five seconds or more, its orientation held, the sphere in
        view."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/live/clock-offset")

    def live_picture(self, session_id: str) -> Any:
        """Return the newest image of the session's camera as it came."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/live/picture")

    def equipment_list_all(self) -> Any:
        """List the register of equipment."""
        return self.request("GET", "/api/v1/equipment")

    def equipment_add(self, body: Mapping[str, Any]) -> Any:
        """Enter a piece of equipment; a session refers to it by `register_id` in `cell.equipment`."""
        return self.request("POST", "/api/v1/equipment", json=body)

    def equipment_get(self, piece: str) -> Any:
        """Return a piece of equipment."""
        return self.request("GET", f"/api/v1/equipment/{quote(piece, safe='')}")

    def equipment_change(self, piece: str, body: Mapping[str, Any]) -> Any:
        """Replace what the register says of a piece; sessions keep what it said when they were stored."""
        return self.request("PUT", f"/api/v1/equipment/{quote(piece, safe='')}", json=body)

    def equipment_remove(self, piece: str) -> Any:
        """Remove a piece from the register; sessions keep what it said."""
        return self.request("DELETE", f"/api/v1/equipment/{quote(piece, safe='')}")

    def equipment_set_certificate(self, piece: str, file: Mapping[str, bytes]) -> Any:
        """Keep the file of a piece's certificate; number, laboratory and date are taken from a digital one
        (DCC)."""
        return self.request("PUT", f"/api/v1/equipment/{quote(piece, safe='')}/certificate", files=[*_files("file", file)])

    def equipment_get_certificate(self, piece: str) -> Any:
        """Return the file of a piece's certificate as it came."""
        return self.request("GET", f"/api/v1/equipment/{quote(piece, safe='')}/certificate")

    def registries_findings(self) -> Any:
        """List the codes that findings may have."""
        return self.request("GET", "/api/v1/findings")

    def registries_finding(self, code: str) -> Any:
        """Return the page about a code."""
        return self.request("GET", f"/api/v1/findings/{quote(code, safe='')}")

    def captures_get_folder(self, session_id: str) -> Any:
        """Return which folder is watched for the session, what came of it, and which may be watched."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/sources/folder")

    def captures_watch_folder(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Watch a folder: each measurement in it becomes a capture once it is whole and has its pose beside
        it."""
        return self.request("PUT", f"/api/v1/sessions/{quote(session_id, safe='')}/sources/folder", json=body)

    def captures_end_watching(self, session_id: str) -> Any:
        """Watch no folder for this session any more; what was taken stays."""
        return self.request("DELETE", f"/api/v1/sessions/{quote(session_id, safe='')}/sources/folder")

    def guidance_get_budget(self, session_id: str, *, x_mm: float | None = None, y_mm: float | None = None, z_mm: float | None = None, field: bool | None = None) -> Any:
        """Return the error budget of the answer at a point of the workpiece, in T or without a table in L.
        Left out, the point is the cell's, or where the sphere stood. `field` adds points all over the
        table."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/budget", params=_given({"x_mm": x_mm, "y_mm": y_mm, "z_mm": z_mm, "field": field}))

    def guidance_get_planned(self, session_id: str, *, captures: int | None = None, step: str | None = None) -> Any:
        """Return the poses that together leave least uncertainty at the workpiece, and what each gains.
        Those of `turntable` come with the table's angle and the sphere's height, those of `verify` keep
        away from the calibration's."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/planned", params=_given({"captures": captures, "step": step}))

    def guidance_get_planned_program(self, session_id: str, *, brand: str, captures: int | None = None, step: str | None = None) -> Any:
        """Return a planned set as a program of a brand: by the flange, slowly, each move started by the
        operator. Refused (409) while the tool is not known to ± 10 mm: approaches could touch."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/planned/program", params=_given({"brand": brand, "captures": captures, "step": step}))

    def guidance_get_recheck(self, session_id: str) -> Any:
        """Return the three poses to capture again with step `recheck`, the sphere still in its place. `POST
        …/solve/recheck` then says whether the calibration still holds."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/recheck")

    def guidance_post_plan(self, body: Mapping[str, Any]) -> Any:
        """Return what a cell will reach before anything is bought: sphere, captures, place. Stores
        nothing."""
        return self.request("POST", "/api/v1/plan", json=body)

    def guidance_get_board(self, *, kind: str, columns: int, rows: int, pitch_mm: float, pitch_y_mm: float | None = None, pitch_sigma_mm: float | None = None, margin_mm: float | None = None, marker_mm: float | None = None, dictionary: str | None = None, flat: bool | None = None, fixed: bool | None = None, paper: str | None = None, form: str | None = None) -> Any:
        """Return a calibration board to print in true scale; measure the print, and tell the pitches as
        measured."""
        return self.request("GET", "/api/v1/board", params=_given({"kind": kind, "columns": columns, "rows": rows, "pitch_mm": pitch_mm, "pitch_y_mm": pitch_y_mm, "pitch_sigma_mm": pitch_sigma_mm, "margin_mm": margin_mm, "marker_mm": marker_mm, "dictionary": dictionary, "flat": flat, "fixed": fixed, "paper": paper, "form": form}))

    def server_health(self) -> Any:
        """Return `ready` once the workers are warm, `starting` before, `stopping` at the end. `degraded`
        where something is away that the server rests on; `reasons` says what and how."""
        return self.request("GET", "/api/v1/health")

    def history_get_timeline(self, session_id: str) -> Any:
        """Return what happened in order: captures, results, solves that failed; the last item is how it
        stands now."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/timeline")

    def history_get_moment(self, session_id: str, place: int) -> Any:
        """Return the session as it stood at one place of its time line: record, captures, results,
        steps."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/timeline/{quote(str(place), safe='')}")

    def history_get_history(self, session_id: str, stage: str) -> Any:
        """List all results that a stage ever had, the newest first."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/results/{quote(stage, safe='')}/history")

    def history_get_past_result(self, session_id: str, stage: str, number: int) -> Any:
        """Return one result of a stage's history."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/results/{quote(stage, safe='')}/history/{quote(str(number), safe='')}")

    def history_compare(self, stage: str, *, left: str, right: str) -> Any:
        """Return two results of a stage side by side, of one session or two: what differs, in units of its
        sigma."""
        return self.request("GET", f"/api/v1/compare/{quote(stage, safe='')}", params=_given({"left": left, "right": right}))

    def history_recompute(self, session_id: str) -> Any:
        """Start solving every stage with a result afresh, to compare; no number of the session is changed.
        Answers at once with the job; its answer has the comparison. Imported results become `replayed` or
        `differs` by it, but for who may only read: then nothing is noted."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/replay")

    def history_get_answer(self, job_id: str) -> Any:
        """Return what a recomputing job found: stored and new side by side."""
        return self.request("GET", f"/api/v1/jobs/{quote(job_id, safe='')}/answer")

    def machines_brands(self) -> Any:
        """List the robot brands and other kinds of files that poses are read from."""
        return self.request("GET", "/api/v1/brands")

    def machines_read_sphere_certificate(self, body: Mapping[str, Any]) -> Any:
        """Return the diameters of a sphere's digital certificate, with their standard uncertainty; stores
        nothing."""
        return self.request("POST", "/api/v1/certificates", json=body)

    def machines_arms(self) -> Any:
        """List the arms that are known by name."""
        return self.request("GET", "/api/v1/arms")

    def machines_read_arm(self, body: Mapping[str, Any]) -> Any:
        """Return an arm's joints as `cell.robot.arm` has them, from its URDF; stores nothing."""
        return self.request("POST", "/api/v1/arms", json=body)

    def machines_read_controller(self, files: Mapping[str, bytes], brand: Any, as_written: Any, told: Any) -> Any:
        """Return poses, tools and frames of a controller's files, before they are used; stores nothing."""
        return self.request("POST", "/api/v1/controller-files", files=[*_files("files", files), *_text("brand", brand), *_text("as_written", as_written), *_text("told", told)])

    def machines_recognise_files(self, files: Mapping[str, bytes], told: Any) -> Any:
        """Return what each file is taken for and why, and measurements paired with their poses; stores
        nothing."""
        return self.request("POST", "/api/v1/recognised-files", files=[*_files("files", files), *_text("told", told)])

    def machines_read_scanner_file(self, file: Mapping[str, bytes], kind: Any, format: Any, settings: Any) -> Any:
        """Return what a reader takes from a file: columns, unit, points, and how sure it is; stores
        nothing."""
        return self.request("POST", "/api/v1/readings", files=[*_files("file", file), *_text("kind", kind), *_text("format", format), *_text("settings", settings)])

    def machines_read_back_tool(self, session_id: str, files: Mapping[str, bytes], tool: Any, brand: Any, numbers: Any, convention: Any) -> Any:
        """Compare the tool in the controller, of its files or as numbers, with the answer: equal, or what
        differs."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/read-back", files=[*_files("files", files), *_text("tool", tool), *_text("brand", brand), *_text("numbers", numbers), *_text("convention", convention)])

    def clouds_section(self, session_id: str, *, axis: str | None = None, at_mm: float | None = None, normal: str | None = None, width_mm: float | None = None, against: str | None = None, diameter_mm: float | None = None) -> Any:
        """Return the points of the merged cloud in a thin slice, at most four thousand of them."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/merged/section", params=_given({"axis": axis, "at_mm": at_mm, "normal": normal, "width_mm": width_mm, "against": against, "diameter_mm": diameter_mm}))

    def clouds_deviation(self, session_id: str, *, against: str | None = None, diameter_mm: float | None = None) -> Any:
        """Return how far the merged cloud lies off the reference mesh or the sphere in it, as it was
        placed."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/merged/deviation", params=_given({"against": against, "diameter_mm": diameter_mm}))

    def clouds_put_reference(self, session_id: str, file: Mapping[str, bytes]) -> Any:
        """Store the mesh that says what the object should be, in place of the one before."""
        return self.request("PUT", f"/api/v1/sessions/{quote(session_id, safe='')}/merged/reference", files=[*_files("file", file)])

    def clouds_delete_reference(self, session_id: str) -> Any:
        """Forget the reference mesh, if there is one."""
        return self.request("DELETE", f"/api/v1/sessions/{quote(session_id, safe='')}/merged/reference")

    def registries_formats(self) -> Any:
        """List the file formats, and what may be said about a file that does not say it itself."""
        return self.request("GET", "/api/v1/formats")

    def registries_conventions(self) -> Any:
        """List the pose conventions: the names that `pose_convention` may have."""
        return self.request("GET", "/api/v1/conventions")

    def registries_exports(self) -> Any:
        """List the exports: the names that `GET …/exports/{name}` takes."""
        return self.request("GET", "/api/v1/exports")

    def registries_sources(self) -> Any:
        """List where captures come from besides uploads."""
        return self.request("GET", "/api/v1/sources")

    def registries_stages(self) -> Any:
        """List the stages: the names that `POST …/solve/{stage}` takes; `all` solves them in their
        order."""
        return self.request("GET", "/api/v1/stages")

    def cells_list_old(self, *, days: float | None = None, quota_mb: float | None = None, cell: str | None = None) -> Any:
        """List the sessions that a rule lets go; nothing is removed, and the answers in force stay. Remove
        one with DELETE and its revision in `If-Match`: it stays where it was changed meanwhile."""
        return self.request("GET", "/api/v1/retention", params=_given({"days": days, "quota_mb": quota_mb, "cell": cell}))

    def live_get_port(self, session_id: str) -> Any:
        """Return the session's port for robot programs."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/robot-port")

    def live_open_port(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Open a plain TCP port for robot programs; each sends a token of the role `capture` in its first
        line. Only the session's captures can be added over it. It is closed after a restart of the
        server."""
        return self.request("PUT", f"/api/v1/sessions/{quote(session_id, safe='')}/robot-port", json=body)

    def live_close_port(self, session_id: str) -> Any:
        """Close the session's port for robot programs."""
        return self.request("DELETE", f"/api/v1/sessions/{quote(session_id, safe='')}/robot-port")

    def live_say(self, session_id: str, content: Any) -> Any:
        """Take one line or XML element of a robot's program and answer with one, as its TCP port does."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/robot", content=content, headers={"Content-Type": "text/plain"})

    def live_list_programs(self) -> Any:
        """List the dialects that robot programs are written in."""
        return self.request("GET", "/api/v1/robot-programs")

    def live_make_program(self, session_id: str, name: str, body: Mapping[str, Any]) -> Any:
        """Return a program that goes through a planned set, a capture at each pose, as a zip of its files.
        Each pose is gone to in a straight line from a point outside; the operator starts every way."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/robot-programs/{quote(name, safe='/')}", json=body)

    def sessions_create(self, body: Mapping[str, Any]) -> Any:
        """Make a session, of a real cell or of the simulated one."""
        return self.request("POST", "/api/v1/sessions", json=body)

    def sessions_list_all(self, *, limit: int | None = None, cursor: str | None = None, search: str | None = None) -> Any:
        """List sessions, the newest first. Without `limit` and `cursor` it is all of them, else a page."""
        return self.whole("GET", "/api/v1/sessions", params=_given({"limit": limit, "cursor": cursor, "search": search}))

    def sessions_get(self, session_id: str) -> Any:
        """Return a session with its captures' records."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}")

    def sessions_change(self, session_id: str, body: Mapping[str, Any], *, if_match: str | None = None) -> Any:
        """Change a session's name or cell; captures are measured anew where the cell's change bears on
        them. Where there are more than a few, that happens after the answer; a `capture` event tells of
        each that is done."""
        return self.request("PATCH", f"/api/v1/sessions/{quote(session_id, safe='')}", json=body, headers={"If-Match": if_match})

    def sessions_delete(self, session_id: str, *, if_match: str | None = None) -> Any:
        """Remove a session with its captures and results, for good; one whose answer is in force is
        kept."""
        return self.request("DELETE", f"/api/v1/sessions/{quote(session_id, safe='')}", headers={"If-Match": if_match})

    def sessions_guidance(self, session_id: str) -> Any:
        """Return what to do now and why, how many captures are still needed, and each step's status."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/guide")

    def sessions_check(self, session_id: str) -> Any:
        """Return what is wrong with the session and what is missing, worst first; an `error` blocks
        solving."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/check")

    def sessions_pose_lines(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Return what pasted pose lines say, to be looked at before they are used; stores nothing."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/pose-lines", json=body)

    def solves_solve(self, session_id: str, stage: str, *, wait: float | None = None) -> Any:
        """Start solving a stage, or `all` that there are captures for; the job's end brings the results."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/solve/{quote(stage, safe='')}", params=_given({"wait": wait}))

    def solves_list_all(self, *, limit: int | None = None, cursor: str | None = None, session: str | None = None, status: str | None = None) -> Any:
        """List jobs, the newest first. Without `limit` and `cursor` it is all of them, else a page."""
        return self.whole("GET", "/api/v1/jobs", params=_given({"limit": limit, "cursor": cursor, "session": session, "status": status}))

    def solves_get_job(self, job_id: str, *, wait: float | None = None) -> Any:
        """Return how far a job is; with `wait` once it has ended, or after so many seconds."""
        return self.request("GET", f"/api/v1/jobs/{quote(job_id, safe='')}", params=_given({"wait": wait}))

    def solves_cancel(self, job_id: str) -> Any:
        """End a job that waits or runs; cancelling it again changes nothing."""
        return self.request("POST", f"/api/v1/jobs/{quote(job_id, safe='')}/cancel")

    def solves_list_results(self, session_id: str) -> Any:
        """Return each stage's latest result; `stale` where captures or cell changed since."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/results")

    def solves_get_result(self, session_id: str, stage: str) -> Any:
        """Return a stage's latest result; `stale` where captures or cell changed since."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/results/{quote(stage, safe='')}")

    def live_list_movers(self) -> Any:
        """List what can move a table, with the JSON Schema of each one's settings."""
        return self.request("GET", "/api/v1/movers")

    def live_get_mover(self, session_id: str) -> Any:
        """Return what is armed for the session."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/table-mover")

    def live_arm_table(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Arm the table's mover for this session, between two angles and for some minutes. This is no
        safety function: the cell's own guards the people in it. It is disarmed after its time, and after a
        restart of the server."""
        return self.request("PUT", f"/api/v1/sessions/{quote(session_id, safe='')}/table-mover", json=body)

    def live_disarm_table(self, session_id: str) -> Any:
        """Stop the table and disarm its mover."""
        return self.request("DELETE", f"/api/v1/sessions/{quote(session_id, safe='')}/table-mover")

    def live_turn_table(self, session_id: str, body: Mapping[str, Any]) -> Any:
        """Turn the table to an angle within the limits and wait until it rests there. It is stopped where
        its angle is no longer told, leaves the limits, or does not come closer."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/table-mover/go", json=body)

    def live_stop_table(self, session_id: str) -> Any:
        """Stop the table now; it stays armed."""
        return self.request("POST", f"/api/v1/sessions/{quote(session_id, safe='')}/table-mover/stop")

    def access_me(self) -> Any:
        """Return who asks and what they may; answers also those who are not logged in."""
        return self.request("GET", "/api/v1/me")

    def access_log_in(self, body: Mapping[str, Any]) -> Any:
        """Log a browser in with a token: the answer sets a cookie that scripts cannot read."""
        return self.request("POST", "/api/v1/login", json=body)

    def access_log_out(self) -> Any:
        """End the login of the cookie that comes with this request, if there is one."""
        return self.request("POST", "/api/v1/logout")

    def access_list_all(self) -> Any:
        """List all tokens, also those that are no longer good; never the tokens themselves."""
        return self.request("GET", "/api/v1/tokens")

    def access_make(self, body: Mapping[str, Any]) -> Any:
        """Make a token. It stands in this answer alone: only a hash of it is kept."""
        return self.request("POST", "/api/v1/tokens", json=body)

    def access_get_token(self, token_id: str) -> Any:
        """Return a token's record, also of one that is no longer good; never the token itself."""
        return self.request("GET", f"/api/v1/tokens/{quote(token_id, safe='')}")

    def access_revoke(self, token_id: str) -> Any:
        """End a token and all logins that were made with it; its streams and scenes end within seconds."""
        return self.request("DELETE", f"/api/v1/tokens/{quote(token_id, safe='')}")

    def access_audit(self, *, limit: int | None = None, cursor: str | None = None) -> Any:
        """List who did what, and who was refused what, the newest first."""
        return self.request("GET", "/api/v1/audit", params=_given({"limit": limit, "cursor": cursor}))

    def results_off_the_truth(self, session_id: str, stage: str) -> Any:
        """Return how far the result of a simulated cell lies from the truth."""
        return self.request("GET", f"/api/v1/sessions/{quote(session_id, safe='')}/truth/{quote(stage, safe='')}")

    def webhooks_list_all(self) -> Any:
        """List all webhooks."""
        return self.request("GET", "/api/v1/webhooks")

    def webhooks_make(self, body: Mapping[str, Any]) -> Any:
        """Make a webhook; its secret stands in this answer alone."""
        return self.request("POST", "/api/v1/webhooks", json=body)

    def webhooks_get_webhook(self, webhook_id: str) -> Any:
        """Return a webhook."""
        return self.request("GET", f"/api/v1/webhooks/{quote(webhook_id, safe='')}")

    def webhooks_remove(self, webhook_id: str) -> Any:
        """Remove a webhook; what waits for its receiver is not sent any more."""
        return self.request("DELETE", f"/api/v1/webhooks/{quote(webhook_id, safe='')}")

    def webhooks_get_deliveries(self, webhook_id: str, *, limit: int | None = None, cursor: str | None = None) -> Any:
        """List what was sent to a webhook or waits to be, the newest first."""
        return self.request("GET", f"/api/v1/webhooks/{quote(webhook_id, safe='')}/deliveries", params=_given({"limit": limit, "cursor": cursor}))

    def webhooks_ping(self, webhook_id: str) -> Any:
        """Send a message of the type `ping`, to try the way to the receiver."""
        return self.request("POST", f"/api/v1/webhooks/{quote(webhook_id, safe='')}/ping")


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _text(name: str, value: Any) -> list[tuple[str, Any]]:
    return [(name, (None, value if isinstance(value, str) else json.dumps(value)))]


def _files(name: str, files: Mapping[str, bytes]) -> list[tuple[str, Any]]:
    return [(name, (file, content)) for file, content in files.items()]
