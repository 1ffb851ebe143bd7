// Asperity in C#, by P/Invoke: for Unity, copy the class and libasperity into the project. The program at the
// end renders a stroke: `mono Asperity.exe GRAPH.ron OUT.f32`.
using System;
using System.IO;
using System.Runtime.InteropServices;
using System.Text;

public sealed class AsperityException : Exception
{
    public AsperityException(string text) : base(text) { }
}

public static class Asperity
{
    public const uint Stroke = 0, Hand = 1;

    [StructLayout(LayoutKind.Sequential)]
    public struct HandSample
    {
        public double X, Y, Z; // mm, z up
        public double ForceN;
        public uint StrokeNumber;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct GraphInfo
    {
        public uint TickHz, AudioHz, Channels, TickFrames;
        public ulong StrokeTicks, Seed;
        public uint HasStylus, HasForce;
    }

    const string Library = "asperity";

    [DllImport(Library)] static extern int asperity_check_version(uint major, uint minor);
    [DllImport(Library)] static extern IntPtr asperity_last_error();
    [DllImport(Library)] static extern int asperity_graph_open(byte[] path, out IntPtr graph);
    [DllImport(Library)] static extern int asperity_graph_set(IntPtr graph, byte[] name, byte[] value);
    [DllImport(Library)] static extern int asperity_graph_info(IntPtr graph, out GraphInfo info);
    [DllImport(Library)] static extern int asperity_graph_free(IntPtr graph);
    [DllImport(Library)] static extern int asperity_engine_new(IntPtr graph, uint stylus, out IntPtr engine);
    [DllImport(Library)]
    static extern int asperity_engine_tick(
        IntPtr engine, ref HandSample hand, [Out] float[] samples, UIntPtr room, out UIntPtr frames);
    [DllImport(Library)] static extern int asperity_engine_free(IntPtr engine);
    [DllImport(Library)] static extern int asperity_live_new(IntPtr graph, uint stylus, out IntPtr live);
    [DllImport(Library)]
    static extern int asperity_live_pull(IntPtr live, [Out] float[] samples, UIntPtr frames, uint channels);
    [DllImport(Library)] static extern int asperity_live_push(IntPtr live, ref HandSample hand, ulong timeNs);
    [DllImport(Library)] static extern int asperity_live_free(IntPtr live);

    static Asperity()
    {
        Check(asperity_check_version(0, 1));
    }

    static void Check(int status)
    {
        if (status != 0)
        {
            throw new AsperityException(Text(asperity_last_error()));
        }
    }

    static string Text(IntPtr at)
    {
        int length = 0;
        while (Marshal.ReadByte(at, length) != 0)
        {
            length++;
        }
        var bytes = new byte[length];
        Marshal.Copy(at, bytes, 0, length);
        return Encoding.UTF8.GetString(bytes);
    }

    static byte[] Utf8(string text)
    {
        return Encoding.UTF8.GetBytes(text + "\0");
    }

    public sealed class Graph : IDisposable
    {
        internal IntPtr Handle;
        public readonly GraphInfo Info;

        public Graph(string path, params string[] settings)
        {
            Check(asperity_graph_open(Utf8(path), out Handle));
            foreach (string setting in settings)
            {
                int at = setting.IndexOf('=');
                Check(asperity_graph_set(Handle, Utf8(setting.Substring(0, at)), Utf8(setting.Substring(at + 1))));
            }
            Check(asperity_graph_info(Handle, out Info));
        }

        public void Dispose()
        {
            asperity_graph_free(Handle);
        }
    }

    // Step by step: in a simulation, or for a render.
    public sealed class Engine : IDisposable
    {
        readonly IntPtr handle;
        readonly float[] samples;
        readonly uint channels;

        public Engine(Graph graph)
        {
            channels = graph.Info.Channels;
            samples = new float[graph.Info.TickFrames * channels];
            Check(asperity_engine_new(graph.Handle, Hand, out handle));
        }

        public ArraySegment<float> Tick(HandSample hand)
        {
            UIntPtr frames;
            Check(asperity_engine_tick(handle, ref hand, samples, (UIntPtr)(uint)samples.Length, out frames));
            return new ArraySegment<float>(samples, 0, (int)(frames.ToUInt32() * channels));
        }

        public void Dispose()
        {
            asperity_engine_free(handle);
        }
    }

    // In real time: call Pull in Unity's OnAudioFilterRead, and Push in Update.
    public sealed class Live : IDisposable
    {
        readonly IntPtr handle;

        public Live(Graph graph)
        {
            Check(asperity_live_new(graph.Handle, Hand, out handle));
        }

        public bool Pull(float[] samples, int channels)
        {
            return asperity_live_pull(handle, samples, (UIntPtr)(uint)(samples.Length / channels), (uint)channels) == 0;
        }

        public bool Push(HandSample hand)
        {
            return asperity_live_push(handle, ref hand, 0) == 0;
        }

        public void Dispose()
        {
            asperity_live_free(handle);
        }
    }

    public static int Main(string[] args)
    {
        using (var graph = new Graph(args[0]))
        using (var file = new BinaryWriter(File.Create(args[1])))
        {
            using (var engine = new Engine(graph))
            {
                for (uint i = 0; i < 2 * graph.Info.TickHz; i++)
                {
                    double t = (double)i / graph.Info.TickHz;
                    ArraySegment<float> heard = engine.Tick(new HandSample { X = 40 * Math.Sin(3 * t), Z = -2 });
                    for (int k = 0; k < heard.Count; k++)
                    {
                        file.Write(heard.Array[k]);
                    }
                }
            }
            using (var live = new Live(graph))
            {
                var block = new float[64 * graph.Info.Channels];
                bool pushed = live.Push(new HandSample { Z = -2 });
                if (!pushed || !live.Pull(block, (int)graph.Info.Channels))
                {
                    throw new AsperityException(Text(asperity_last_error()));
                }
            }
        }
        try
        {
            new Graph("none.ron").Dispose();
        }
        catch (AsperityException e)
        {
            Console.WriteLine("refused, as it should: " + e.Message.Split('\n')[0]);
            return 0;
        }
        return 1;
    }
}
