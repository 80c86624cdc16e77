SET TimeZone = 'UTC';                                       -- moments are shown, and months counted, in UTC
CREATE MACRO stands_where(file, robot, session, run) AS     -- whether a file stands where its rows say
    list_transform(string_split(file, '/')[-3:], lambda part: url_decode(part)) = [robot, session, run || '.parquet'];
CREATE VIEW runs AS
SELECT * FROM read_parquet('lake/runs/*/*/*.parquet', filename = true, union_by_name = true)
WHERE stands_where(filename, robot, session, run);
SET VARIABLE asked_files = (SELECT CASE count(*) WHEN 0 THEN 'lake/runs/*/*/*.parquet' ELSE 'lake/asked/*/*/*.parquet' END
                            FROM glob('lake/asked/*/*/*.parquet'));
CREATE VIEW asked AS                                        -- requests that changed the current run, none of earlier versions
SELECT robot, session, run, number, replaced, asked_at FROM (
    SELECT NULL::BIGINT AS number, NULL::VARCHAR AS replaced, NULL::TIMESTAMPTZ AS asked_at WHERE false UNION ALL BY NAME
    SELECT * FROM read_parquet(coalesce(getvariable('asked_files'), 'lake/asked/*/*/*.parquet'), filename = true, union_by_name = true))
WHERE stands_where(filename, robot, session, format('{:08d}', number));
