/** What a view whose eye moves makes of a term: how many functions of the incoming light it takes, and what they miss. */
import { useEffect, useState } from "preact/hooks";
import { getInOut } from "../net/api";
import type { InOutBody, Term } from "../protocol";
import { moves } from "../state/views";

const AFTER_MS = 250; // a slider that moves asks once, when it rests

function words({ functions, missed, needed, is_mirror }: InOutBody): string {
  const percent = missed < 0.01 ? "less than 1 %" : `${Math.round(100 * missed)} %`;
  if (is_mirror) return `While the eye moves: a blurred mirror. ${functions} terms would miss ${percent} of this highlight.`;
  const enough = needed === null ? "" : needed === 1 ? "; one misses less than 5 %" : `; ${needed} miss less than 5 %`;
  return `While the eye moves: ${functions} terms, which miss ${percent}${enough}.`;
}

export function InMotion({ term }: { term: Term }) {
  const [told, setTold] = useState<InOutBody | null>(null);
  const isCover = term.model === "measured_btf";
  const asked = moves.value && !isCover ? JSON.stringify(term) : null;
  useEffect(() => {
    if (asked === null) return undefined;
    let isOld = false;
    const timer = setTimeout(() => {
      getInOut([JSON.parse(asked) as Term]).then(
        ([found]) => !isOld && setTold(found ?? null),
        () => !isOld && setTold(null), // a term that is refused is said where it is edited
      );
    }, AFTER_MS);
    return () => {
      isOld = true;
      clearTimeout(timer);
    };
  }, [asked]);
  if (moves.value && isCover) {
    return <p class="in-motion">While the eye moves: its texels in simplified light; where this browser draws, their mean.</p>;
  }
  if (asked === null || told === null) return null;
  return (
    <p class="in-motion" title="In-out factorisation of this term, cosine-weighted RMS. Where the eye rests it is exact.">
      {words(told)}
    </p>
  );
}
