/** The image of a material map: choose, upload, drop, remove. */
import { ImageChoice, type ImageChoiceProps } from "./ImageChoice";
import { onDrop } from "./importImages";

export function MapImageField(props: ImageChoiceProps) {
  const { label, title, material, assign } = props;
  return (
    <div class="map-image" onDrop={() => onDrop(Promise.resolve(material), assign)}>
      <span class="param-label">{label}</span>
      <ImageChoice {...props} title={`${title} You can also drop an image here.`} />
    </div>
  );
}
