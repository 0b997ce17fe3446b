// The walk of docs/rest.md with the types that openapi-typescript generates and openapi-fetch: node walk.js ADDRESS FOLDER.
import { readFileSync } from "node:fs";
import { basename, join } from "node:path";
import createClient from "openapi-fetch";
import type { components, paths } from "./api.js";

type Upload = components["schemas"]["CaptureUpload"];

const [, , address, folder] = process.argv as [string, string, string, string];
const api = createClient<paths>({ baseUrl: address });

function must(holds: unknown, what: string): asserts holds {
  if (!holds) throw new Error(what);
}

function form(body: unknown): FormData {
  const data = new FormData();
  for (const [name, value] of Object.entries(body as Record<string, unknown>))
    for (const one of Array.isArray(value) ? value : [value])
      if (one instanceof File) data.append(name, one, one.name);
      else data.append(name, String(one));
  return data;
}

const record = JSON.parse(readFileSync(join(folder, "session.json"), "utf-8"));
const captures: components["schemas"]["Capture"][] = record.captures;
delete record.captures;
const made = await api.POST("/api/v1/sessions", { body: record, params: { header: { "idempotency-key": crypto.randomUUID() } } });
must(made.data && made.response.headers.get("ETag") && made.response.headers.get("Location"), "made");
const session_id: string = made.data.id;
const here = { session_id };
for (const capture of captures) {
  const files = (capture.files ?? []).map((name: string) => new File([readFileSync(join(folder, name))], basename(name)));
  const body: Upload = { record: JSON.stringify(capture), files: files as unknown as string[] };
  const added = await api.POST("/api/v1/sessions/{session_id}/captures", { params: { path: here }, body, bodySerializer: form });
  must(added.data && added.data.measured.verdict !== "fail", "added");
}
const first = captures[0]!;
const path = { session_id, capture_id: first.id };
const got = await api.GET("/api/v1/sessions/{session_id}/captures/{capture_id}", { params: { path } });
const etag = got.response.headers.get("ETag")!;
const same = await api.GET("/api/v1/sessions/{session_id}/captures/{capture_id}", { params: { path }, headers: { "If-None-Match": etag } });
must(same.response.status === 304, "unchanged");
const change = (tag: string) =>
  api.PATCH("/api/v1/sessions/{session_id}/captures/{capture_id}", {
    params: { path, header: { "if-match": tag } }, body: { source: "walk" } });
const late = await change('"999"');
must(late.error && late.error.status === 412 && late.error.to_do.length > 0, "late");
must((await change(etag)).data?.source === "walk", "changed");
const name = basename(first.files![0]!);
const file = await api.GET("/api/v1/sessions/{session_id}/captures/{capture_id}/files/{name}", {
  params: { path: { ...path, name } }, parseAs: "arrayBuffer" });
must(Buffer.from(file.data!).equals(readFileSync(join(folder, first.files![0]!))), "file");
must((await api.GET("/api/v1/sessions/{session_id}/guide", { params: { path: here } })).data?.steps, "guide");
must((await api.GET("/api/v1/sessions/{session_id}/check", { params: { path: here } })).data?.items, "check");
const job = await api.POST("/api/v1/sessions/{session_id}/solve/{stage}", { params: { path: { session_id, stage: "tcp" }, query: { wait: 60 } } });
const status: components["schemas"]["Job"]["status"] | undefined = job.data?.status;
must(status === "done", "solved");
const answer = await api.GET("/api/v1/sessions/{session_id}/answer", { params: { path: here } });
must(answer.data && !answer.data.stale && answer.response.headers.get("Scancell-Stale") === "false", "answer");
for (const format of ["json", "kuka", "abb"]) {
  const exported = await api.GET("/api/v1/sessions/{session_id}/exports/{name}", {
    params: { path: { session_id, name: format } }, parseAs: "arrayBuffer" });
  must(exported.data!.byteLength > 100, format);
}
const report = await api.GET("/api/v1/sessions/{session_id}/report", { params: { path: here }, parseAs: "text" });
must(report.data!.includes("<html"), "report");
const archive = await api.GET("/api/v1/sessions/{session_id}/archive", {
  params: { path: here, query: { scene: false } }, parseAs: "arrayBuffer" });
const zip = new File([archive.data!], "cell.zip");
const imported = await api.POST("/api/v1/archives", { body: { file: zip as unknown as string } as never, bodySerializer: form });
must(imported.data?.name === record.name, "imported");
const released = await api.POST("/api/v1/sessions/{session_id}/release", { params: { path: here }, body: { why: "walk", allow: "" } });
const cell_id = released.data!.cell;
must((await api.GET("/api/v1/cells/{cell_id}/answer", { params: { path: { cell_id } } })).data?.inputs_sha256, "in force");
const missing = await api.GET("/api/v1/sessions/{session_id}", { params: { path: { session_id: "nothing" } } });
must(missing.error?.type === "urn:scancell:problem:not-found", "missing");
must((await api.GET("/api/v1/exports")).data!.items.length > 5, "exports");
const hook = await api.POST("/api/v1/webhooks", { body: { url: "http://127.0.0.1:9/" } as never });
const gone = await api.DELETE("/api/v1/webhooks/{webhook_id}", { params: { path: { webhook_id: hook.data!.id } } });
must(gone.response.status === 204, "gone");
console.log("walked");
