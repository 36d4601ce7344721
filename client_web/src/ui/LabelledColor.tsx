/** A colour below its visible label. */
import { ColorField, type ColorProps } from "./ColorField";

interface Props extends ColorProps {
  /** What is shown of the label: the panel says the rest. */
  shown: string;
}

export function LabelledColor({ shown, ...color }: Props) {
  return (
    <div class="param alone">
      <span class="param-label">{shown}</span>
      <ColorField {...color} />
    </div>
  );
}
