/** The plot without hands: one canvas, painted when what it shows has changed. */
import { useLayoutEffect, useRef } from "preact/hooks";
import { paintPlot, type PlotContent } from "./paint";
import type { Frame } from "./plotScale";

interface Props extends PlotContent {
  frame: Frame;
}

export function Plot({ frame, ...content }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { width, height, axes } = frame;
  useLayoutEffect(
    () => paintPlot(canvas.current as HTMLCanvasElement, frame, content),
    [width, height, axes.stretched, axes.log, axes.top, ...Object.values(content)],
  );
  return <canvas ref={canvas} aria-hidden="true" style={{ width: `${width}px`, height: `${height}px` }} />;
}
