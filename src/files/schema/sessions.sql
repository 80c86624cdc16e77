CREATE VIEW current_runs AS                                 -- asked for last, or where none was, not replaced
SELECT r.* FROM runs AS r
LEFT JOIN (SELECT robot, session, run, max(number) AS number
           FROM (SELECT robot, session, run, number FROM asked UNION ALL SELECT robot, session, replaces, -1 FROM runs) GROUP BY ALL) AS a
    ON a.robot = r.robot AND a.session = r.session AND a.run = r.run
QUALIFY row_number() OVER (PARTITION BY r.robot, r.session ORDER BY coalesce(a.number, 0) DESC, r.run DESC) = 1;
CREATE VIEW sessions AS                                     -- one row a session: what people ask first
SELECT session_started, robot, session, mean_before_mm AS before_mm, mean_after_mm AS after_mm, means_of, bound_mm, verdict, verdict_of, run
FROM current_runs WHERE verdict_of IS DISTINCT FROM 'sampling_plan';
CREATE MACRO current(name) AS TABLE                         -- the rows of a table that are of current runs: FROM current('stations')
SELECT t.* FROM (SELECT * FROM read_parquet('lake/' || name || '/*/*/*.parquet', filename = true, union_by_name = true)
                 WHERE stands_where(filename, robot, session, run)) AS t SEMI JOIN current_runs USING (robot, session, run);
CREATE MACRO figures() AS TABLE                             -- errors of positions at stations that took no part: a row a figure
SELECT robot, session, of_session AS judged_by, model, angles, point, evidence, name AS figure, value AS mm, expanded_uncertainty AS u_mm, n
FROM current('accuracy') WHERE quantity = 'position_error' AND role <> 'training' AND base_refit = 'none' AND pose IS NULL;
CREATE VIEW changes AS                                      -- one row a run that took the place of another: what changed, and by what
SELECT new.robot, new.session, new.session_started, old.version AS version_was, new.version,
       old.settings_digest <> new.settings_digest AS other_settings, old.input_digests <> new.input_digests AS other_inputs,
       old.verdict AS verdict_was, new.verdict, old.bound_mm AS bound_was_mm, new.bound_mm,
       old.mean_after_mm AS after_was_mm, new.mean_after_mm AS after_mm, old.run AS run_was, new.run
FROM runs AS new JOIN runs AS old ON (old.robot, old.session, old.run) = (new.robot, new.session, new.replaces);
