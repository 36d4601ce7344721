/** A clay picture from the server; the previous one stays until the next has loaded. */
import { useState } from "preact/hooks";

interface ClayImageProps {
  url: string;
  /** Text for screen readers; empty: decoration. */
  label: string;
  isLazy?: boolean;
}

export function ClayImage({ url, label, isLazy = false }: ClayImageProps) {
  const [loaded, setLoaded] = useState({ url: "", isFailed: false });
  if (loaded.url === url && loaded.isFailed) return <span class="no-picture">No clay picture available</span>;
  return (
    <img
      class={`clay ${loaded.url === url ? "" : "is-loading"}`}
      src={url}
      alt={label}
      loading={isLazy ? "lazy" : "eager"}
      onLoad={() => setLoaded({ url, isFailed: false })}
      onError={() => setLoaded({ url, isFailed: true })}
    />
  );
}
