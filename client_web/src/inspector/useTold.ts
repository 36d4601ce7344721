/** What the server says of something that is edited, asked for once it rests. */
import { useEffect, useState } from "preact/hooks";

const AFTER_MS = 250; // a slider that moves asks once

/** The answer to `asked`, the one before it until it is there; null where nothing is asked or it was refused, which is
 * said where it is edited. */
export function useTold<T>(asked: string | null, ask: (asked: string) => Promise<T | null>): T | null {
  const [told, setTold] = useState<T | null>(null);
  useEffect(() => {
    if (asked === null) return undefined;
    let isOld = false;
    const timer = setTimeout(() => {
      ask(asked).then(
        (found) => !isOld && setTold(found),
        () => !isOld && setTold(null),
      );
    }, AFTER_MS);
    return () => {
      isOld = true;
      clearTimeout(timer);
    };
  }, [asked]);
  return asked === null ? null : told;
}
