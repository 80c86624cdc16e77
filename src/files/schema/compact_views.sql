SET TimeZone = 'UTC';                                       -- moments are shown, and months counted, in UTC
CREATE MACRO stands_where(file, robot, session, run) AS     -- whether a file stands where its rows say
    list_transform(string_split(file, '/')[-3:], lambda part: url_decode(part)) = [robot, session, run || '.parquet'];
SET VARIABLE state = (SELECT max(file) FROM glob('lake/compact/states/*.jsonl'));           -- the newest state names the files
CREATE VIEW compact_files AS SELECT "table", month, 'lake/' || file AS file FROM read_json(getvariable('state'));
SET VARIABLE run_files = (SELECT list(file) FROM compact_files WHERE "table" = 'runs');
SET VARIABLE asked_files = (SELECT list(file) FROM compact_files WHERE "table" = 'asked');
SET VARIABLE accuracy_files = (SELECT list(file) FROM compact_files WHERE "table" = 'accuracy');
CREATE VIEW runs AS
SELECT * FROM read_parquet(getvariable('run_files'), filename = true, union_by_name = true)
WHERE starts_with(filename, 'lake/compact/') OR stands_where(filename, robot, session, run);
CREATE VIEW accuracy AS
SELECT * FROM read_parquet(getvariable('accuracy_files'), filename = true, union_by_name = true)
WHERE starts_with(filename, 'lake/compact/') OR stands_where(filename, robot, session, run);
CREATE VIEW asked AS                                        -- requests that changed the current run, none of earlier versions
SELECT robot, session, run, number, replaced, asked_at FROM (
    SELECT NULL::BIGINT AS number, NULL::VARCHAR AS replaced, NULL::TIMESTAMPTZ AS asked_at WHERE false UNION ALL BY NAME
    SELECT * FROM read_parquet(coalesce(getvariable('asked_files'), getvariable('run_files')), filename = true, union_by_name = true))
WHERE starts_with(filename, 'lake/compact/asked/') OR stands_where(filename, robot, session, format('{:08d}', number));
