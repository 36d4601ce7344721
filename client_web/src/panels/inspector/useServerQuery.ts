/** A server query about an edited value, sent once editing pauses. */
import { useEffect, useState } from "preact/hooks";

const AFTER_MS = 250; // one query per slider drag

/** The response to `query`, or the previous one until then; null without a query or if it was rejected, which the
 * edit itself reports. `fetchAnswer` stays the same function: another one asks again. */
export function useServerQuery<T>(query: string | null, fetchAnswer: (queryText: string) => Promise<T | null>): T | null {
  const [answer, setAnswer] = useState<T | null>(null);
  useEffect(() => {
    if (query === null) return undefined;
    let isOld = false;
    const timer = setTimeout(() => {
      fetchAnswer(query).then(
        (result) => !isOld && setAnswer(result),
        () => !isOld && setAnswer(null),
      );
    }, AFTER_MS);
    return () => {
      isOld = true;
      clearTimeout(timer);
    };
  }, [query, fetchAnswer]);
  return query === null ? null : answer;
}
