/** A slider below its visible label. */
import { Slider, type SliderProps } from "./Slider";

interface Props extends SliderProps {
  /** Where the label is longer than what is shown: the panel says the rest. */
  shown?: string;
  title?: string;
}

export function LabelledSlider({ shown, title, ...slider }: Props) {
  return (
    <div class="param alone">
      <span class="param-label" title={title}>
        {shown ?? slider.label}
      </span>
      <Slider {...slider} />
    </div>
  );
}
