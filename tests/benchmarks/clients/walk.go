// The walk of docs/rest.md with the client that openapi-generator makes for Go: go run ./walk ADDRESS FOLDER.
package main

import (
	"bytes"
	"context"
	"encoding/json"
	"fmt"
	"net/http"
	"os"
	"path/filepath"

	scancell "github.com/GIT_USER_ID/GIT_REPO_ID"
)

func must(holds bool, what string, about ...any) {
	if !holds {
		fmt.Println(append([]any{what}, about...)...)
		os.Exit(1)
	}
}

func main() {
	ctx, folder := context.Background(), os.Args[2]
	settings := scancell.NewConfiguration()
	settings.Servers = scancell.ServerConfigurations{{URL: os.Args[1]}}
	api := scancell.NewAPIClient(settings)

	text, err := os.ReadFile(filepath.Join(folder, "session.json"))
	must(err == nil, "session.json", err)
	var record map[string]json.RawMessage
	must(json.Unmarshal(text, &record) == nil, "record")
	var captures []struct {
		Id    string   `json:"id"`
		Files []string `json:"files"`
	}
	var plain []json.RawMessage
	must(json.Unmarshal(record["captures"], &captures) == nil && json.Unmarshal(record["captures"], &plain) == nil, "captures")
	delete(record, "captures")
	rest, _ := json.Marshal(record)
	var body scancell.SessionRequest
	must(json.Unmarshal(rest, &body) == nil, "body")
	made, answer, err := api.SessionsAPI.SessionsCreate(ctx).SessionRequest(body).IdempotencyKey("walk-in-go").Execute()
	must(err == nil && answer.StatusCode == http.StatusCreated && answer.Header.Get("ETag") != "", "made", err)
	session := made.GetId()
	for k, capture := range captures {
		var files []*os.File
		for _, name := range capture.Files {
			file, err := os.Open(filepath.Join(folder, name))
			must(err == nil, "file", err)
			files = append(files, file)
		}
		added, _, err := api.CapturesAPI.CapturesAdd(ctx, session).Record(string(plain[k])).Files(files).Execute()
		must(err == nil, "added", err)
		must(added.GetId() == capture.Id, "added", added.GetId())
	}
	first := captures[0].Id
	_, answer, err = api.CapturesAPI.CapturesGet(ctx, session, first).Execute()
	must(err == nil, "got", err)
	etag := answer.Header.Get("ETag")
	source := "walk"
	changes := scancell.CaptureChanges{AdditionalProperties: map[string]any{"source": source}}
	_, answer, err = api.CapturesAPI.CapturesChange(ctx, session, first).CaptureChanges(changes).IfMatch(`"999"`).Execute()
	must(err != nil && answer.StatusCode == http.StatusPreconditionFailed, "an old tag was taken")
	_, _, err = api.CapturesAPI.CapturesChange(ctx, session, first).CaptureChanges(changes).IfMatch(etag).Execute()
	must(err == nil, "changed", err)
	stored, _, err := api.CapturesAPI.CapturesGetFile(ctx, session, first, filepath.Base(captures[0].Files[0])).Execute()
	must(err == nil, "file", err)
	mine, _ := os.ReadFile(filepath.Join(folder, captures[0].Files[0]))
	theirs, _ := os.ReadFile(stored.Name())
	must(bytes.Equal(mine, theirs), "file")
	job, _, err := api.SolvesAPI.SolvesSolve(ctx, session, "tcp").Wait(60).Execute()
	must(err == nil && string(job.GetStatus()) == "done", "solved", err)
	found, answer, err := api.AnswersAPI.AnswersGetAnswer(ctx, session).Execute()
	must(err == nil && !found.GetStale() && answer.Header.Get("Scancell-Stale") == "false", "answer", err)
	released, _, err := api.CellsAPI.CellsRelease(ctx, session).ReleaseRequest(scancell.ReleaseRequest{Why: scancell.PtrString("walk")}).Execute()
	must(err == nil, "released", err)
	_, _, err = api.CellsAPI.CellsGetReleased(ctx, released.GetCell()).Execute()
	must(err == nil, "in force", err)
	_, answer, err = api.SessionsAPI.SessionsGet(ctx, "nothing").Execute()
	must(err != nil && answer.StatusCode == http.StatusNotFound, "missing")
	fmt.Println("walked")
}
