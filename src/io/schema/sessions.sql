CREATE VIEW current_runs AS                                 -- asked for last, or where none was, not replaced
SELECT r.* FROM runs AS r
LEFT JOIN (SELECT robot, session, run, max(number) AS number
           FROM (SELECT robot, session, run, number FROM asked UNION ALL SELECT robot, session, replaces, -1 FROM runs) GROUP BY ALL) AS a
    ON a.robot = r.robot AND a.session = r.session AND a.run = r.run
QUALIFY row_number() OVER (PARTITION BY r.robot, r.session ORDER BY coalesce(a.number, 0) DESC, r.run DESC) = 1;
CREATE VIEW sessions AS                                     -- one row a session: what people ask first
SELECT session_started, robot, session, mean_before_mm AS before_mm, mean_after_mm AS after_mm, means_of, bound_mm, verdict, verdict_of, run
FROM current_runs WHERE verdict_of IS DISTINCT FROM 'sampling_plan';
