CREATE MACRO stands_where(file, robot, session, run) AS     -- whether a file stands where its rows say
    list_transform(string_split(file, '/')[-3:], lambda part: url_decode(part)) = [robot, session, run || '.parquet'];
CREATE VIEW runs AS
SELECT * FROM read_parquet('lake/runs/*/*/*.parquet', filename = true, union_by_name = true)
WHERE stands_where(filename, robot, session, run);
CREATE VIEW current_runs AS
SELECT * FROM runs AS r
WHERE NOT EXISTS (SELECT 1 FROM runs AS later
                  WHERE later.replaces = r.run AND later.robot = r.robot AND later.session = r.session);
CREATE VIEW sessions AS                                     -- one row a session: what people ask first
SELECT session_started, robot, session, mean_before_mm AS before_mm, mean_after_mm AS after_mm, means_of, bound_mm, verdict, verdict_of, run
FROM current_runs WHERE verdict_of IS DISTINCT FROM 'sampling_plan';
