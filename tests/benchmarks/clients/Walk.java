// The walk of docs/rest.md with the client that openapi-generator makes for Java: java -cp … Walk ADDRESS FOLDER.
import com.fasterxml.jackson.databind.JsonNode;
import com.fasterxml.jackson.databind.ObjectMapper;
import com.fasterxml.jackson.databind.node.ObjectNode;
import java.io.File;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Map;
import org.openapitools.client.ApiClient;
import org.openapitools.client.ApiException;
import org.openapitools.client.ApiResponse;
import org.openapitools.client.api.*;
import org.openapitools.client.model.*;

public class Walk {
    static void must(boolean holds, String what) {
        if (!holds) throw new AssertionError(what);
    }

    static String header(ApiResponse<?> answer, String name) {
        return answer.getHeaders().entrySet().stream().filter(e -> e.getKey().equalsIgnoreCase(name))
            .map(e -> e.getValue().get(0)).findFirst().orElse("");
    }

    public static void main(String[] arguments) throws Exception {
        ApiClient client = new ApiClient();
        client.updateBaseUri(arguments[0]);
        Path folder = Path.of(arguments[1]);
        ObjectMapper json = ApiClient.createDefaultObjectMapper();
        ObjectNode record = (ObjectNode) new ObjectMapper().readTree(folder.resolve("session.json").toFile());
        JsonNode captures = record.remove("captures");

        SessionsApi sessions = new SessionsApi(client);
        SessionRequest body = json.treeToValue(record, SessionRequest.class);
        ApiResponse<StoredSession> made = sessions.sessionsCreateWithHttpInfo(body, java.util.UUID.randomUUID().toString());
        must(made.getStatusCode() == 201 && !header(made, "ETag").isEmpty(), "made");
        String session = made.getData().getId();
        must(header(made, "Location").endsWith(session), "location");

        CapturesApi api = new CapturesApi(client);
        for (JsonNode capture : captures) {
            List<File> files = new ArrayList<>();
            for (JsonNode name : capture.get("files")) files.add(folder.resolve(name.asText()).toFile());
            StoredCapture added = api.capturesAdd(session, capture.toString(), null, files);
            must(!added.getMeasured().getVerdict().getValue().equals("fail"), "added");
        }
        String first = captures.get(0).get("id").asText();
        ApiResponse<StoredCapture> got = api.capturesGetWithHttpInfo(session, first);
        String etag = header(got, "ETag");
        try {
            ApiResponse<StoredCapture> same = api.capturesGetWithHttpInfo(session, first, Map.of("If-None-Match", etag));
            must(same.getStatusCode() == 304, "unchanged");
        } catch (ApiException unchanged) {
            must(unchanged.getCode() == 304, "unchanged: " + unchanged.getCode());
        }
        CaptureChanges changes = new CaptureChanges();
        changes.putAdditionalProperty("source", "walk");
        try {
            api.capturesChange(session, first, changes, "\"999\"");
            must(false, "an old tag was taken");
        } catch (ApiException late) {
            Problem problem = json.readValue(late.getResponseBody(), Problem.class);
            must(late.getCode() == 412 && !problem.getToDo().isEmpty(), "late");
        }
        must("walk".equals(api.capturesChange(session, first, changes, etag).getSource()), "changed");
        Path file = folder.resolve(captures.get(0).get("files").get(0).asText());
        File stored = api.capturesGetFile(session, first, file.getFileName().toString());
        must(Arrays.equals(Files.readAllBytes(stored.toPath()), Files.readAllBytes(file)), "file");
        must(sessions.sessionsGuidance(session).getSteps() != null, "guide");
        must(sessions.sessionsCheck(session).getItems() != null, "check");

        Job job = new SolvesApi(client).solvesSolve(session, "tcp", java.math.BigDecimal.valueOf(60), null);
        must(job.getStatus() == Job.StatusEnum.DONE, "solved");
        AnswersApi answers = new AnswersApi(client);
        ApiResponse<SessionAnswer> answer = answers.answersGetAnswerWithHttpInfo(session);
        must(!answer.getData().getStale() && header(answer, "Scancell-Stale").equals("false"), "answer");
        for (String format : List.of("json", "kuka", "abb"))
            must(answers.answersExportResults(session, format, "", null).length() > 100, format);
        ArchivesApi archives = new ArchivesApi(client);
        must(Files.readString(archives.archivesGetReport(session, null, null, null).toPath()).contains("<html"), "report");
        File archive = archives.archivesGetArchive(session, false);
        StoredSession imported = archives.archivesImportArchive(archive, null);
        must(imported.getName().equals(record.get("name").asText()), "imported");
        CellsApi cells = new CellsApi(client);
        ReleaseRequest why = new ReleaseRequest();
        why.setWhy("walk");
        Release released = cells.cellsRelease(session, why, null);
        must(cells.cellsGetReleased(released.getCell()).getInputsSha256() != null, "in force");
        try {
            sessions.sessionsGet("nothing");
            must(false, "a session that is not there");
        } catch (ApiException missing) {
            Problem problem = json.readValue(missing.getResponseBody(), Problem.class);
            must(problem.getType().endsWith("not-found"), "missing");
        }
        must(new RegistriesApi(client).registriesExports().getItems().size() > 5, "exports");
        WebhookRequest hook = new WebhookRequest();
        hook.setUrl("http://127.0.0.1:9/");
        new WebhooksApi(client).webhooksRemove(new WebhooksApi(client).webhooksMake(hook, null).getId());
        System.out.println("walked");
    }
}
