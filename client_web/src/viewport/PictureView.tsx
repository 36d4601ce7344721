/** The picture of one view, or those of several side by side, with what is said about them. */
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { EyeBar } from "../cameras/EyeBar";
import { PlacingBar } from "../lights/PlacingBar";
import { shownViews, view } from "../state/views";
import { Toasts } from "../ui/toasts";
import { Cell } from "./Cell";
import { FalseColourLegend } from "./FalseColourLegend";
import { HistogramView } from "./HistogramView";
import { Limits } from "./Limits";
import { PictureBar } from "./PictureBar";
import { columnsFor } from "./grid";

/** The size of an element, followed. */
function useSize() {
  const element = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState<[width: number, height: number]>([1, 1]);
  useLayoutEffect(() => {
    const measured = element.current as HTMLDivElement;
    const measure = () => setSize([measured.clientWidth, measured.clientHeight]);
    const observer = new ResizeObserver(measure);
    measure();
    observer.observe(measured);
    return () => observer.disconnect();
  }, []);
  return { element, size };
}

export function PictureView() {
  const { element, size } = useSize();
  const shown = shownViews.value;
  const columns = columnsFor(shown.length, ...size, view.value === null ? 1 : view.value.width / view.value.height);
  return (
    <main class="picture">
      <div class="canvas" ref={element}>
        <div class="cells" style={{ "--columns": columns }}>
          {shown.map((name, place) => (
            // a canvas keeps its place, whichever view it shows: a graphics context is slow to make
            <Cell key={place} view={name} />
          ))}
        </div>
        <EyeBar />
        <PlacingBar />
        <Limits />
        <HistogramView />
        <Toasts />
      </div>
      <FalseColourLegend />
      <PictureBar />
    </main>
  );
}
