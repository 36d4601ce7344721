/** The plot without interaction: one canvas, repainted when its content changes. */
import { useLayoutEffect, useRef } from "preact/hooks";
import { paintPlot, type PlotContent } from "./plotPainter";
import type { PlotFrame } from "./plotScale";

interface Props extends PlotContent {
  frame: PlotFrame;
}

export function Plot({ frame, ...content }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { width, height, axes } = frame;
  useLayoutEffect(
    () => paintPlot(canvas.current as HTMLCanvasElement, frame, content),
    // eslint-disable-next-line react-hooks/exhaustive-deps -- the content's fields are compared one by one
    [width, height, axes.stretched, axes.log, axes.top, ...Object.values(content)],
  );
  return <canvas ref={canvas} aria-hidden="true" style={{ width: `${width}px`, height: `${height}px` }} />;
}
