/** A color below its visible label. */
import { ColorField, type ColorProps } from "./ColorField";

interface Props extends ColorProps {
  /** Shorter visible label, if the panel gives the context. */
  shortLabel: string;
}

export function LabeledColor({ shortLabel, ...color }: Props) {
  return (
    <div class="param alone">
      <span class="param-label">{shortLabel}</span>
      <ColorField {...color} />
    </div>
  );
}
