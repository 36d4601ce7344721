/** Work that waits until frames pause. */
import { useEffect, useState } from "preact/hooks";
import { displayedFrames } from "../state/display";

const IDLE_MS = 250;

/** Number of the frame after which drawing paused; −1 before the first pause. */
export function useIdleFrame(): number {
  const [idleFrame, setIdleFrame] = useState(-1);
  const frame = displayedFrames.value;
  useEffect(() => {
    const timer = setTimeout(() => setIdleFrame(frame), IDLE_MS);
    return () => clearTimeout(timer);
  }, [frame]);
  return idleFrame;
}
