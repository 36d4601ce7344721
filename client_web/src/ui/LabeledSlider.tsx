/** A slider below its visible label. */
import { Slider, type SliderProps } from "./Slider";

interface Props extends SliderProps {
  /** Shorter visible label, if the panel gives the context. */
  shortLabel?: string;
  title?: string;
}

export function LabeledSlider({ shortLabel, title, ...slider }: Props) {
  return (
    <div class="param alone">
      <span class="param-label" title={title}>
        {shortLabel ?? slider.label}
      </span>
      <Slider {...slider} />
    </div>
  );
}
