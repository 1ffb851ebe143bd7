% Renders a stroke in Octave, and writes its samples: octave-cli render.m GRAPH.ron OUT.f32
arguments = argv ();
t = (0:999)' / 500;
samples = asperity_render (arguments{1}, [40 * sin(3 * t), zeros(1000, 1), -2 * ones(1000, 1)]);
file = fopen (arguments{2}, "w");
fwrite (file, samples, "single");
fclose (file);
printf ("%d samples, loudest %.4f of full scale\n", numel (samples), max (abs (samples(:))));
try
  asperity_render (arguments{1}, [0 0 0], "texture.material", "oka");
  exit (1);
catch e
  printf ("refused, as it should: %s\n", strtok (e.message, "\n"));
end
