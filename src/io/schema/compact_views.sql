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
    SELECT NULL::BIGINT AS number, NULL::VARCHAR AS replaced, NULL::TIMESTAMP AS asked_at WHERE false UNION ALL BY NAME
    SELECT * FROM read_parquet(coalesce(getvariable('asked_files'), getvariable('run_files')), filename = true, union_by_name = true))
WHERE starts_with(filename, 'lake/compact/asked/') OR stands_where(filename, robot, session, format('{:08d}', number));
CREATE VIEW current_runs AS                                 -- asked for last, or where none was, not replaced
SELECT r.* FROM runs AS r
LEFT JOIN (SELECT robot, session, run, max(number) AS number
           FROM (SELECT robot, session, run, number FROM asked UNION ALL SELECT robot, session, replaces, -1 FROM runs) GROUP BY ALL) AS a
    ON a.robot = r.robot AND a.session = r.session AND a.run = r.run
QUALIFY row_number() OVER (PARTITION BY r.robot, r.session ORDER BY coalesce(a.number, 0) DESC, r.run DESC) = 1;
CREATE VIEW sessions AS                                     -- one row a session: what people ask first
SELECT session_started, robot, session, mean_before_mm AS before_mm, mean_after_mm AS after_mm, means_of, bound_mm, verdict, verdict_of, run
FROM current_runs WHERE verdict_of IS DISTINCT FROM 'sampling_plan';
